"""Random people: every trait drawn from a distribution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeVar

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_studio.people.traits.person_traits import (
    BeardStyle,
    BrowTraits,
    Color,
    GlassesTraits,
    HairStyle,
    Proportions,
    RestingExpression,
    Traits,
)

Choice = TypeVar("Choice", bound=str)

SKINS: tuple[Color, ...] = (
    (0.66, 0.44, 0.35), (0.60, 0.385, 0.295), (0.56, 0.345, 0.24), (0.48, 0.285, 0.19), (0.40, 0.225, 0.145),
    (0.31, 0.17, 0.105), (0.225, 0.118, 0.072), (0.165, 0.080, 0.046), (0.125, 0.058, 0.033), (0.098, 0.045, 0.026),
)  # fmt: skip
"""Linear albedo from light to dark."""
_LIGHT_IRISES: tuple[Color, ...] = ((0.13, 0.24, 0.33), (0.17, 0.22, 0.12), (0.16, 0.20, 0.22), (0.20, 0.14, 0.06))
_DARK_IRISES: tuple[Color, ...] = ((0.14, 0.065, 0.025), (0.075, 0.035, 0.015), (0.045, 0.02, 0.01))
_SHIRTS: tuple[Color, ...] = (
    (0.02, 0.035, 0.07), (0.30, 0.05, 0.06), (0.50, 0.48, 0.44), (0.03, 0.09, 0.06), (0.035, 0.035, 0.038),
    (0.42, 0.25, 0.05), (0.09, 0.16, 0.27), (0.20, 0.09, 0.13), (0.16, 0.17, 0.17), (0.28, 0.17, 0.10),
    (0.10, 0.20, 0.19), (0.36, 0.20, 0.17),
)  # fmt: skip
_FRAMES: tuple[GlassesTraits, ...] = (
    GlassesTraits(), GlassesTraits("square", (0.06, 0.012, 0.012)), GlassesTraits("round", (0.05, 0.02, 0.008)),
    GlassesTraits("round", (0.55, 0.38, 0.16), 0.07, True), GlassesTraits("wide", (0.30, 0.30, 0.31), 0.07, True),
    GlassesTraits("wide", (0.012, 0.02, 0.05)),
)  # fmt: skip


class Pigment(NamedTuple):
    """Melanin and redness of hair."""

    melanin: float
    redness: float


PIGMENTS: Mapping[str, Pigment] = {
    "black": Pigment(0.94, 0.12),
    "dark": Pigment(0.82, 0.3),
    "brown": Pigment(0.66, 0.4),
    "light": Pigment(0.5, 0.4),
    "blond": Pigment(0.26, 0.3),
    "red": Pigment(0.48, 0.95),
}
"""Hair colors by name."""


def random_traits(seed: int) -> Traits:
    """A random person, the same for the same seed; all skin tones are equally likely, and so are women and men."""
    rng = np.random.default_rng(seed + 50_000)
    tone = int(rng.integers(len(SKINS)))
    dark = tone / (len(SKINS) - 1)
    feminine, age = bool(rng.random() < 0.5), float(rng.uniform(19, 68))
    old = float(smoothstep(age, 30, 68))
    pigment = PIGMENTS[_pigment_name(rng, dark)]
    hair, beard = _hair_style(rng, feminine, dark, old), _beard_style(rng, feminine)
    light_eyes = dark < 0.45 and rng.random() < 0.7 - 0.8 * dark - 0.3 * (pigment.melanin > 0.9)
    irises = _LIGHT_IRISES if light_eyes else _DARK_IRISES
    wears = rng.random() < 0.25 + 0.3 * old
    return Traits(
        name=str(seed),
        seed=seed,
        spread=0.95,
        proportions=_proportions(rng, feminine, dark),
        resting=_resting(rng),
        skin=_jittered(rng, SKINS[tone], 0.05),
        contrast=float(rng.uniform(0.85, 1.1)) - 0.15 * dark,
        relief=(0.55 if feminine else 0.8) + 0.7 * old,
        age=old,
        freckles=float(
            rng.uniform(0.3, 1.5) + (5 * rng.random() if pigment.redness > 0.9 or rng.random() < 0.15 else 0)
        ),
        gloss=0.15 + 0.6 * dark,
        flush=float(rng.uniform(0.1, 0.5)),
        shaved=not feminine and dark < 0.5 and (beard != "none" or bool(rng.random() < 0.6)),
        hair=hair,
        melanin=float(np.clip(pigment.melanin + 0.03 * rng.normal(), 0.2, 1)),
        redness=float(np.clip(pigment.redness + 0.05 * rng.normal(), 0.05, 1)),
        grey=float(np.clip(smoothstep(age, 36, 66) * rng.uniform(0.3, 1.4), 0, 0.97)),
        beard=beard,
        iris=irises[int(rng.integers(len(irises)))],
        lips=(1.0, 0.74, 0.76) if feminine and dark < 0.6 else (1.1, 0.87, 0.87),
        brows=_brows(rng, feminine),
        lashes=float(rng.uniform(1.2, 1.5) if feminine else rng.uniform(0.7, 1.0)),
        glasses=_FRAMES[int(rng.integers(len(_FRAMES)))] if wears else None,
        shirt=_jittered(rng, _SHIRTS[int(rng.integers(len(_SHIRTS)))], 0.1),
        neckline="collar" if rng.random() < 0.3 else "crew",
    )


def _pigment_name(rng: np.random.Generator, dark: float) -> str:
    if dark > 0.7:
        return _drawn(rng, {"black": 0.85, "dark": 0.15})
    if dark > 0.35:
        return _drawn(rng, {"black": 0.55, "dark": 0.35, "brown": 0.1})
    return _drawn(rng, {"black": 0.1, "dark": 0.22, "brown": 0.22, "light": 0.14, "blond": 0.18, "red": 0.14})


def _hair_style(rng: np.random.Generator, feminine: bool, dark: float, old: float) -> HairStyle:
    weights: dict[HairStyle, float]
    coily = max(0.0, dark - 0.45)
    if feminine:
        weights = {
            "long": 1.2, "bob": 1.1, "ponytail": 0.6, "bun": 0.7, "curly": 0.6, "crop": 0.2, "afro": 2.2 * coily,
            "buzz": 0.4 * coily,
        }  # fmt: skip
    else:
        weights = {
            "short": 0.9, "swept": 0.9, "crop": 0.9, "back": 0.6, "curly": 0.5, "buzz": 0.3 + 2.0 * coily,
            "afro": 1.4 * coily, "receding": 1.6 * old, "bald": 0.25 + 1.1 * old, "bun": 0.15, "long": 0.1,
        }  # fmt: skip
    # Combed styles are rarer with very dark skin, where tight curls are common.
    if dark > 0.75:
        weights |= {
            style: 0.25 * weights[style] for style in ("short", "swept", "back", "long", "bob") if style in weights
        }
    return _drawn(rng, weights)


def _beard_style(rng: np.random.Generator, feminine: bool) -> BeardStyle:
    drawn: BeardStyle = _drawn(rng, {"none": 0.38, "stubble": 0.2, "moustache": 0.1, "goatee": 0.12, "full": 0.2})
    return "none" if feminine else drawn


def _brows(rng: np.random.Generator, feminine: bool) -> BrowTraits:
    if feminine:
        return BrowTraits(
            int(rng.integers(340, 520)), float(rng.uniform(0.6, 0.75)), float(rng.uniform(0.75, 0.95)),
            float(rng.uniform(1.05, 1.4)), float(rng.uniform(0.1, 0.45)),
        )  # fmt: skip
    return BrowTraits(
        int(rng.integers(400, 680)), float(rng.uniform(0.7, 0.95)), float(rng.uniform(0.85, 1.15)),
        float(rng.uniform(1.2, 1.65)), float(rng.uniform(0.25, 0.6)),
    )  # fmt: skip


def _resting(rng: np.random.Generator) -> RestingExpression:
    return RestingExpression(
        eyes_wide=float(rng.uniform(-0.45, 0.05)),
        smile=float(rng.uniform(-0.25, 0.3)),
        brows_up=float(rng.uniform(-0.15, 0.25)),
        lips_pressed=float(rng.uniform(-0.1, 0.12)),
    )


def _proportions(rng: np.random.Generator, feminine: bool, dark: float) -> Proportions:
    """Random proportions about the means of the person's sex; noses and lips get wider with darker skin."""
    sex = -1.0 if feminine else 1.0
    broad = dark - 0.4

    def drawn(mean: float, spread: float) -> float:
        return float(mean + spread * np.clip(rng.normal(), -1.6, 1.6))

    return Proportions(
        jaw_width=drawn(0.6 * sex - 0.3, 0.6),
        chin_height=drawn(0.5 * sex, 0.7),
        nose_width=drawn(0.35 * sex + 1.5 * broad, 0.5),
        nose_length=drawn(0.4 * sex - 0.4 * broad, 0.7),
        mouth_width=drawn(0.2 * sex, 0.7),
        lip_height=drawn(-0.3 * sex + 1.6 * broad, 0.5),
        eye_height=drawn(-0.3 * sex, 0.5),
        brow_depth=drawn(0.8 * sex, 0.5),
        face_width=drawn(0.2 * sex, 0.7),
    )


def _jittered(rng: np.random.Generator, color: Color, amount: float) -> Color:
    lighter = 1 + amount * rng.normal()
    red, green, blue = (
        float(np.clip(value * lighter * (1 + 0.3 * amount * rng.normal()), 0.01, 0.8)) for value in color
    )
    return red, green, blue


def _drawn(rng: np.random.Generator, weights: Mapping[Choice, float]) -> Choice:
    chances = np.array(list(weights.values()))
    return list(weights)[int(rng.choice(len(chances), p=chances / chances.sum()))]
