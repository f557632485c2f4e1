"""Who a person is, as a few numbers, and the people who have names."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from relit_camera.errors import NotFoundError
from relit_studio.people.face_model import IDENTITIES
from relit_studio.people.geometry import Floats

Colour = tuple[float, float, float]
HairStyle = Literal["short", "long", "buzz"]


@dataclass(frozen=True)
class BrowTraits:
    """A side's count of hairs, their length (cm) and thickness, the brow's width, and how flat it lies (0 arched)."""

    hairs: int = 520
    length_cm: float = 0.85
    thickness: float = 1.0
    width: float = 1.5
    flatness: float = 0.4


@dataclass(frozen=True)
class Traits:
    """One person.

    Attributes:
        name: of the person.
        seed: of everything random about them.
        spread: of the identity weights; 0 is the mean head.
        skin: mean linear albedo.
        contrast: of the photographed skin about that mean.
        beard: whether the skin shows a shaved beard.
        hair: style.
        melanin, redness: of hair and brows, 0..1.
        iris: linear albedo.
        lips: factor on the photographed lips.
        brows: see `BrowTraits`.
        lashes: factor on their number.
        shirt: linear albedo.
    """

    name: str
    seed: int
    spread: float = 0.8
    skin: Colour = (0.61, 0.37, 0.28)
    contrast: float = 1.0
    beard: bool = True
    hair: HairStyle = "short"
    melanin: float = 0.75
    redness: float = 0.35
    iris: Colour = (0.16, 0.25, 0.30)
    lips: Colour = (1.0, 1.0, 1.0)
    brows: BrowTraits = BrowTraits()
    lashes: float = 1.0
    shirt: Colour = (0.02, 0.035, 0.07)

    def identity(self) -> Floats:
        """Identity weights (100,): random, falling off with the order of the shapes."""
        drawn = np.random.default_rng(self.seed).normal(size=IDENTITIES)
        return np.asarray(drawn * self.spread * np.exp(-np.arange(IDENTITIES) / 35))


CAST = {
    person.name: person
    for person in (
        Traits(
            "adam", 855, skin=(0.58, 0.36, 0.27), melanin=0.72, redness=0.4, iris=(0.13, 0.24, 0.33),
        ),
        Traits(
            "bea", 14, skin=(0.50, 0.30, 0.205), beard=False, hair="long", melanin=0.88, redness=0.25,
            iris=(0.14, 0.065, 0.025), lips=(1.0, 0.72, 0.75), brows=BrowTraits(380, 0.7, 1.0, 1.05, 0.15),
            lashes=1.35, shirt=(0.30, 0.05, 0.06),
        ),
        Traits(
            "cem", 866, skin=(0.115, 0.056, 0.034), contrast=0.85, beard=False, hair="buzz", melanin=1.0, redness=0.1,
            iris=(0.045, 0.02, 0.01), lips=(1.15, 0.85, 0.85), brows=BrowTraits(560, 0.6, 1.1, 1.35, 0.45),
            shirt=(0.28, 0.27, 0.24),
        ),
    )
}  # fmt: skip
"""People with a name."""

_SKINS = (
    (0.64, 0.41, 0.32), (0.58, 0.36, 0.27), (0.50, 0.30, 0.205), (0.40, 0.225, 0.145), (0.29, 0.155, 0.095),
    (0.19, 0.097, 0.059), (0.115, 0.056, 0.034), (0.075, 0.038, 0.025),
)  # fmt: skip
"""Linear albedo from light to dark."""
_IRISES = ((0.13, 0.24, 0.33), (0.17, 0.22, 0.12), (0.14, 0.065, 0.025), (0.045, 0.02, 0.01))
_SHIRTS = ((0.02, 0.035, 0.07), (0.30, 0.05, 0.06), (0.28, 0.27, 0.24), (0.03, 0.09, 0.06), (0.05, 0.05, 0.05))


def find_traits(name: str) -> Traits:
    """A person of the cast, or the random person of a number.

    Raises:
        NotFoundError: neither.
    """
    if name in CAST:
        return CAST[name]
    if name.isdecimal():
        return random_traits(int(name))
    raise NotFoundError(f"no person '{name}'", f"use {', '.join(CAST)}, or a number for a random person")


def random_traits(seed: int) -> Traits:
    """A random person; skins from light to dark are equally likely."""
    rng = np.random.default_rng(seed + 50_000)
    tone = int(rng.integers(len(_SKINS)))
    dark = tone / (len(_SKINS) - 1)
    feminine = bool(rng.random() < 0.5)
    hair: HairStyle = (
        "long" if feminine and rng.random() < 0.75 else ("buzz" if rng.random() < 0.2 + 0.5 * dark else "short")
    )
    light_eyes = dark < 0.3 and rng.random() < 0.7
    base = CAST["bea"] if feminine else CAST["adam"]
    return replace(
        base,
        name=str(seed),
        seed=seed,
        skin=_SKINS[tone],
        contrast=1.0 - 0.2 * dark,
        beard=not feminine and dark < 0.45 and bool(rng.random() < 0.6),
        hair=hair,
        melanin=float(np.clip(rng.normal(0.78 + 0.3 * dark, 0.12), 0.25, 1)),
        redness=float(rng.uniform(0.05, 0.5) * (1 - 0.7 * dark)),
        iris=_IRISES[int(rng.integers(2)) if light_eyes else int(rng.integers(2, 4))],
        shirt=_SHIRTS[int(rng.integers(len(_SHIRTS)))],
    )
