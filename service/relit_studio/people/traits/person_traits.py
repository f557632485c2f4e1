"""Traits of a person: the numbers and names from which everything else is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Color = tuple[float, float, float]
HairStyle = Literal[
    "short", "swept", "crop", "back", "curly", "afro", "bob", "long", "ponytail", "bun", "receding", "bald", "buzz"
]
BeardStyle = Literal["none", "stubble", "moustache", "goatee", "full"]
LensShape = Literal["round", "square", "wide"]
Neckline = Literal["crew", "collar"]


@dataclass(frozen=True)
class Proportions:
    """Facial proportions in standard deviations of the face model's people; 0 is the mean.

    Attributes:
        jaw_width, chin_height, nose_width, nose_length, mouth_width, lip_height, eye_height, brow_depth, face_width:
            larger is wider, longer, fuller, more open, farther in front of the eyes.
    """

    jaw_width: float = 0.0
    chin_height: float = 0.0
    nose_width: float = 0.0
    nose_length: float = 0.0
    mouth_width: float = 0.0
    lip_height: float = 0.0
    eye_height: float = 0.0
    brow_depth: float = 0.0
    face_width: float = 0.0


@dataclass(frozen=True)
class RestingExpression:
    """Weights of expression shapes that a face has at rest; negative weights are the opposite expression."""

    eyes_wide: float = 0.0
    smile: float = 0.0
    brows_up: float = 0.0
    lips_pressed: float = 0.0


@dataclass(frozen=True)
class BrowTraits:
    """One brow's number of hairs, their length (cm) and relative thickness, its width, and its flatness (0 arched)."""

    hairs: int = 520
    length_cm: float = 0.85
    thickness: float = 1.0
    width: float = 1.5
    flatness: float = 0.4


@dataclass(frozen=True)
class GlassesTraits:
    """Shape of the lenses; linear albedo and thickness of the frame, and whether it is metal."""

    shape: LensShape = "square"
    colour: Color = (0.01, 0.01, 0.012)
    rim_cm: float = 0.16
    metal: bool = False


@dataclass(frozen=True)
class Traits:
    """One person.

    Attributes:
        name: of the person.
        seed: of everything random about them.
        spread: of the identity weights; 0 is the mean head.
        proportions: of the face; None leaves them as drawn with the identity weights.
        resting: of the face without expression.
        skin: mean linear albedo.
        contrast: of the photographed skin about that mean.
        relief: strength of pores and lines.
        age: of the skin, 0 young to 1 old: folds, spots, bags under the eyes.
        freckles: factor on their number.
        gloss: how narrow its highlights are, 0 dull to 1 oiled.
        flush: how red cheeks and nose are, 0..1.
        shaved: whether the skin shows a shaved beard.
        hair: style.
        melanin, redness: of hair and brows, 0..1.
        grey: fraction of hairs without color.
        beard: style.
        iris: linear albedo.
        lips: factor on the photographed lips.
        brows: see `BrowTraits`.
        lashes: factor on their number.
        glasses: None wears none.
        shirt: linear albedo.
        neckline: of the shirt; "collar" is that of another, white shirt below.
    """

    name: str
    seed: int
    spread: float = 0.8
    proportions: Proportions | None = None
    resting: RestingExpression = RestingExpression()
    skin: Color = (0.61, 0.37, 0.28)
    contrast: float = 1.0
    relief: float = 0.9
    age: float = 0.0
    freckles: float = 1.0
    gloss: float = 0.0
    flush: float = 0.0
    shaved: bool = True
    hair: HairStyle = "short"
    melanin: float = 0.75
    redness: float = 0.35
    grey: float = 0.0
    beard: BeardStyle = "none"
    iris: Color = (0.16, 0.25, 0.30)
    lips: Color = (1.0, 1.0, 1.0)
    brows: BrowTraits = BrowTraits()
    lashes: float = 1.0
    glasses: GlassesTraits | None = None
    shirt: Color = (0.02, 0.035, 0.07)
    neckline: Neckline = "crew"
