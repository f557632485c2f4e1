"""Hair stepped along a comb, with gravity, kept out of the head and the clothes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_studio.people.geometry import unit
from relit_studio.people.hair.scalp import Obstacle, Roots


@dataclass(frozen=True, eq=False)
class Combing:
    """Growth of combed hair.

    Attributes:
        direction: (n, 3) unit vectors along which hairs are combed.
        length_cm: (n,).
        lift: (n,) how far hairs rise from the skin at first.
        gravity: (n,) pull downwards, a step.
        layer_cm: (n,) distance above `offset_cm` that a hair keeps from the skin.
        points: number of points of a hair.
        offset_cm: least distance from the skin away from the root.
        loose_from: fraction of the length at which the combing's influence has fallen to 0.
        frees_face: whether hair is kept out of the face and pulled in below the ears.
        waviness_cm, waves: amplitude and number of a single hair's waves.
    """

    direction: Float64Array
    length_cm: Float64Array
    lift: Float64Array
    gravity: Float64Array
    layer_cm: Float64Array
    points: int
    offset_cm: float
    loose_from: float
    frees_face: bool
    waviness_cm: float
    waves: float


def combed(roots: Roots, combing: Combing, obstacle: Obstacle, rng: np.random.Generator) -> Float64Array:
    """Polylines (n, points, 3), grown step by step along the combing and gravity, and kept out of the head."""
    count, last = len(roots.place), combing.points - 1
    step = (combing.length_cm / last)[:, None]
    place = roots.place.copy()
    direction = unit(roots.normal * combing.lift[:, None] + combing.direction + 0.16 * rng.normal(size=(count, 3)))
    grown = [place]
    for index in range(1, combing.points):
        along = index / last
        _, normal = obstacle.nearest(place)
        comb = combing.direction - (combing.direction * normal).sum(axis=1, keepdims=True) * normal
        hold = 0.45 * float(np.clip(1 - along / combing.loose_from, 0, 1))
        pull = combing.gravity[:, None] * np.array([0, -1, 0])
        direction = unit(direction + hold * comb + pull + 0.03 * rng.normal(size=(count, 3)))
        place = place + direction * step
        surface, normal = obstacle.nearest(place)
        wanted = combing.offset_cm * min(1, 4 * along) + combing.layer_cm * min(1, 3 * along)
        gap = ((place - surface) * normal).sum(axis=1)
        close = np.linalg.norm(place - surface, axis=1) < 4
        push = np.where(close, np.clip(wanted - gap, 0, None), 0)[:, None]
        if combing.frees_face:
            place = out_of_face(place)
        place = place + normal * push
        direction = unit(direction + 0.5 * normal * push / step)
        grown.append(place)
    return np.stack(grown, axis=1)


def kept_out(points: Float64Array, obstacle: Obstacle) -> Float64Array:
    """Polylines (n, points, 3), with points inside the obstacle moved to its surface."""
    flat = points.reshape(-1, 3)
    surface, normal = obstacle.nearest(flat)
    gap = ((flat - surface) * normal).sum(axis=1)
    near = np.linalg.norm(flat - surface, axis=1) < 4
    return np.asarray((flat + (near * np.clip(-gap, 0, None))[:, None] * normal).reshape(points.shape))


def out_of_face(place: Float64Array) -> Float64Array:
    """Points (..., 3) moved out of the face and sideways off the throat, and pulled in below the ears."""
    x, y, z = np.moveaxis(place, -1, 0)
    throat = smoothstep(z, -1.5, 2.5) * smoothstep(-2.5 - y, 0, 3) * smoothstep(7.4 - np.abs(x), 0, 2)
    x = x + 0.7 * np.sign(x) * throat
    face = smoothstep(z, 2, 7) * smoothstep(9.5 - y, 0, 2) * smoothstep(8.6 - np.abs(x), 0, 2)
    x = x + 0.9 * np.sign(x) * face
    below = 0.13 * smoothstep(3.5 - y, 0, 5)
    x = x - np.sign(x) * np.clip(np.abs(x) - 7.4, 0, None) * below
    z = z - 1.1 * face + np.clip(-5.5 - z, 0, None) * below
    return np.stack([x, y, z], axis=-1)
