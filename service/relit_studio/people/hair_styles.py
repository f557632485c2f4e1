"""How hair is combed: for each root a direction, a length, and how it stands, lies and falls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_studio.people.geometry import Floats, smoothstep, unit
from relit_studio.people.scalp import Roots


@dataclass(frozen=True, eq=False)
class Combing:
    """How hairs grow from their roots.

    Attributes:
        direction: (n, 3) the comb's, unit.
        length_cm: (n,).
        lift: (n,) how far hairs rise from the skin at first.
        gravity: (n,) pull downwards, a step.
        layer_cm: (n,) distance above `offset_cm` that a hair keeps from the skin.
        points: of a hair.
        offset_cm: least distance from the skin away from the root.
        loose_from: share of the length from which the comb no longer holds, 1 for never quite.
        frees_face: hair is kept out of the face and drawn in below the ears.
        waviness_cm, waves: amplitude and count of a hair's own waves.
    """

    direction: Floats
    length_cm: Floats
    lift: Floats
    gravity: Floats
    layer_cm: Floats
    points: int
    offset_cm: float
    loose_from: float
    frees_face: bool
    waviness_cm: float
    waves: float


def short(roots: Roots, rng: np.random.Generator) -> Combing:
    """Parted at the picture's right, longer on top, cut at the sides and the nape."""
    count = len(roots.place)
    x, y, z = roots.place.T
    parting = 3.1
    side = smoothstep(np.abs(x), 5.2, 7.4) * smoothstep(y, 12.5, 9)
    front, back = smoothstep(z, 3, 8.5) * smoothstep(y, 8.5, 11), smoothstep(-z, 2, 6)
    beyond = smoothstep(x + 0.25 * rng.normal(size=count), parting - 0.5, parting + 0.5)[:, None]
    swept = np.stack([np.full(count, -0.75), np.full(count, 0.2), -0.5 + 0.2 * front], axis=1)
    top = swept * (1 - beyond) + np.array([0.55, -0.6, -0.5]) * beyond
    direction = unit(top * (1 - side[:, None]) + 1.4 * np.array([0, -1, -0.45]) * side[:, None])
    direction = unit(direction * (1 - back[:, None]) + np.array([0, -1, -0.2]) * back[:, None])

    length = (np.where(x > parting, 3.4, 5.0) * (1 - side) + 1.3 * side) * (1 - 0.65 * back)
    length *= (0.35 + 0.65 * roots.density) * rng.uniform(0.75, 1.1, count)
    length *= np.where(side > 0.8, 0.9 * smoothstep(y, 0, 9) + 0.3, 1)
    nape = smoothstep(y, 4.5, -1) * smoothstep(z, 2, -1)
    thick = 1.15 * (1 - side) * (1 - 0.6 * back) * np.where(x > parting, 0.6, 1) + 0.1
    return Combing(
        direction=direction,
        length_cm=length * (1 - 0.7 * nape),
        lift=0.5 + 0.75 * front * (x < parting) + 0.5 * np.exp(-(((x - parting) / 0.8) ** 2)),
        gravity=0.06 + 0.1 * side,
        layer_cm=(0.15 + rng.random(count) * thick) * (1 - 0.8 * nape),
        points=14,
        offset_cm=0.25,
        loose_from=1.0,
        frees_face=False,
        waviness_cm=0.08,
        waves=0.8,
    )


def long(roots: Roots, rng: np.random.Generator) -> Combing:
    """Parted near the middle, falling behind the shoulders' front."""
    count = len(roots.place)
    x, y, z = roots.place.T
    outward = np.where(x > 1.2, 1.0, -1.0) * (1.1 - 0.5 * smoothstep(-z, 0, 6))
    direction = unit(np.stack([outward, np.full(count, -0.35), np.full(count, -0.75)], axis=1))
    length = rng.uniform(21.5, 25.5, count) * (0.85 + 0.15 * roots.density) - 0.85 * (13 - y).clip(0, 20)
    return Combing(
        direction=direction,
        length_cm=length,
        lift=np.full(count, 0.35),
        gravity=np.full(count, 0.53),
        layer_cm=0.2 + 1.1 * rng.random(count),
        points=34,
        offset_cm=0.35,
        loose_from=1 / 2.2,
        frees_face=True,
        waviness_cm=0.16,
        waves=1.4,
    )
