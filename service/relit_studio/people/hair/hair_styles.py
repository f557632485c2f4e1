"""Combing of each hair style."""

from __future__ import annotations

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_studio.people.geometry import unit
from relit_studio.people.hair.hair_combing import Combing
from relit_studio.people.hair.scalp import Roots


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


def swept(roots: Roots, rng: np.random.Generator) -> Combing:
    """Brushed up from the forehead and over to one side, close at the sides."""
    way = 1.0 if rng.random() < 0.5 else -1.0
    return _cut(
        roots, rng, top=np.array([0.8 * way, 0.25, -0.35]), top_cm=5.5, side_cm=1.2, rise=1.5, irregularity=0.25
    )


def back(roots: Roots, rng: np.random.Generator) -> Combing:
    """Brushed straight back."""
    return _cut(roots, rng, top=np.array([0.0, 0.2, -1.0]), top_cm=6.5, side_cm=2.2, rise=0.9, irregularity=0.15)


def crop(roots: Roots, rng: np.random.Generator) -> Combing:
    """Cut to a few centimeters, without a parting."""
    return _cut(roots, rng, top=np.array([0.15, 0.1, 0.75]), top_cm=2.7, side_cm=1.0, rise=0.9, irregularity=0.8)


def receding(roots: Roots, rng: np.random.Generator) -> Combing:
    """Thin and short on top, brushed back."""
    return _cut(roots, rng, top=np.array([0.1, 0.1, -0.8]), top_cm=2.4, side_cm=1.1, rise=0.35, irregularity=0.4)


def curly(roots: Roots, rng: np.random.Generator) -> Combing:
    """Loose curls down to the ears."""
    count = len(roots.place)
    y, z = roots.place[:, 1], roots.place[:, 2]
    radial = unit(roots.place - [0, 4, -1])
    nape = smoothstep(y, 4.5, -1) * smoothstep(z, 2, -1)
    front = smoothstep(z, 4, 8)
    return Combing(
        direction=unit(
            0.7 * radial + [0, -0.25, 0] - 0.55 * front[:, None] * [0, -0.6, 1] + 0.8 * _direction_noise(roots, rng)
        ),
        length_cm=rng.uniform(5.0, 7.0, count) * (0.45 + 0.55 * roots.density) * (1 - 0.6 * nape),
        lift=np.full(count, 1.1),
        gravity=np.full(count, 0.12),
        layer_cm=0.3 + 1.9 * rng.random(count) * (1 - 0.7 * nape),
        points=26,
        offset_cm=0.3,
        loose_from=0.8,
        frees_face=False,
        waviness_cm=0.05,
        waves=1.0,
    )


def bob(roots: Roots, rng: np.random.Generator) -> Combing:
    """Parted at one side, to the jaw."""
    return _hanging(roots, rng, end_cm=-5.5, layers_cm=2.0, gravity=0.42, points=30)


def long(roots: Roots, rng: np.random.Generator) -> Combing:
    """Parted at one side, over the shoulders."""
    return _hanging(roots, rng, end_cm=-16.0, layers_cm=6.0, gravity=0.40, points=40)


def _cut(
    roots: Roots,
    rng: np.random.Generator,
    *,
    top: Float64Array,
    top_cm: float,
    side_cm: float,
    rise: float,
    irregularity: float,
) -> Combing:
    """Long on top, combed along `top`; short and flat at the sides and the nape."""
    count = len(roots.place)
    x, y, z = roots.place.T
    side = smoothstep(np.abs(x), 4.8, 7.2) * smoothstep(y, 12.0, 9.0)
    behind = smoothstep(-z, 1.5, 6)
    low = np.maximum(side, behind)[:, None]
    front = smoothstep(z, 3, 8.5) * smoothstep(y, 8.5, 11)
    down = np.stack([np.zeros(count), np.full(count, -1.0), -0.35 * side], axis=1)
    direction = unit(unit(top) * (1 - low) + down * low + irregularity * (1 - 0.6 * low) * _direction_noise(roots, rng))
    nape = smoothstep(y, 5.0, -1) * smoothstep(z, 2, -1)
    length = top_cm * (1 - low[:, 0]) + side_cm * low[:, 0]
    # Tapered below the top of the ears.
    length *= (0.4 + 0.6 * roots.density) * rng.uniform(0.7, 1.1, count) * (1 - 0.75 * nape)
    length *= np.where(side > 0.5, 0.35 + 0.65 * smoothstep(y, 1, 9), 1)
    return Combing(
        direction=direction,
        length_cm=length,
        lift=0.45 + rise * (0.35 + 0.65 * front) * (1 - low[:, 0]),
        gravity=np.full(count, 0.05),
        layer_cm=0.1 + rng.random(count) * (0.16 * top_cm * (1 - low[:, 0]) + 0.15) * (1 - 0.8 * nape),
        points=14,
        offset_cm=0.15,
        loose_from=1.0,
        frees_face=False,
        waviness_cm=0.12,
        waves=0.8,
    )


def _hanging(
    roots: Roots, rng: np.random.Generator, *, end_cm: float, layers_cm: float, gravity: float, points: int
) -> Combing:
    """Parted at a random place, hanging down to about the height `end_cm`, in layers."""
    count = len(roots.place)
    x, y, z = roots.place.T
    parting = rng.uniform(0.8, 2.8) * (1 if rng.random() < 0.5 else -1)
    # A straight parting would look artificial.
    ragged = parting + 0.35 * np.sin(1.3 * z + 6.28 * rng.random()) + 0.12 * rng.normal(size=count)
    sign = np.where(x > ragged, 1.0, -1.0)
    outward = sign * (1.0 - 0.5 * smoothstep(-z, 0, 6))
    irregularity = _direction_noise(roots, rng)
    direction = unit(np.stack([outward, np.full(count, -0.3), np.full(count, -0.65)], axis=1) + 0.35 * irregularity)
    layer = rng.random(count)
    beside = np.exp(-(((x - ragged) / 1.6) ** 2)) * smoothstep(z, -5, 3)
    drop = y - end_cm + 0.5 * np.hypot(x, z - 1) * smoothstep(y, 8, 14)
    return Combing(
        direction=direction,
        length_cm=(drop + 2.0 - layers_cm * layer**2 * rng.random(count)) * (0.85 + 0.15 * roots.density),
        lift=0.35 + 0.75 * beside,
        gravity=gravity * rng.uniform(0.75, 1.25, count),
        layer_cm=0.15 + 1.5 * layer,
        points=points,
        offset_cm=0.35,
        loose_from=0.45,
        frees_face=True,
        waviness_cm=0.15,
        waves=1.4,
    )


def _direction_noise(roots: Roots, rng: np.random.Generator, wave_cm: float = 5.0) -> Float64Array:
    """Random directions (n, 3), of about unit length, that vary smoothly over the head, as hair growth does."""
    total = np.zeros_like(roots.place)
    for _ in range(5):
        wave = 6.28 / wave_cm * unit(rng.normal(size=3)) * rng.uniform(0.5, 1.4)
        total += np.sin(roots.place @ wave + 6.28 * rng.random())[:, None] * rng.normal(size=3)
    return np.asarray(total / np.sqrt(7.5))
