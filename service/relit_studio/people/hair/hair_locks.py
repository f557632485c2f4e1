"""Grouping of hairs: locks, curls and stray hairs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array, Indices
from relit_studio.people.geometry import find_nearest, unit

_HEAD_MIDDLE = np.array([0.0, 3.0, 0.0])
_STRAYS = 0.03
"""Fraction of stray hairs, which leave their lock."""


class Locks(NamedTuple):
    """Grouping of hairs into locks.

    `hairs` a lock, how strongly they are drawn together at the tip, how late that begins (`onset`), by how many
    centimeters a whole lock's tip lies higher or lower than its neighbors', and how much lighter or darker locks are.
    """

    hairs: int
    strength: float
    onset: float
    lift_cm: float
    shade: float = 0.45


class Curl(NamedTuple):
    """Helix around the path of a lock: radius and pitch. `own` is the random part of a single hair's phase."""

    radius_cm: float
    pitch_cm: float
    own: float = 0.08


def in_locks(
    points: Float64Array, scales: Sequence[Locks], fraction: float, rng: np.random.Generator
) -> tuple[Float64Array, Float64Array, Indices]:
    """Hairs (n, points, 3) gathered at each scale in turn, of which only a `fraction` has been grown.

    Returns their points, their shades (n,), and each one's guide (n,) at the last scale.
    """
    guide = np.arange(len(points))
    shade = 0.35 * rng.normal(size=len(points))
    for locks in scales:
        guide = _guides(points[:, 0], fraction * locks.hairs, rng)
        points = _gathered(points, guide, locks, rng)
        shade += locks.shade * rng.normal(size=len(points))[guide]
    return points, shade, guide


def _guides(roots: Float64Array, hairs: float, rng: np.random.Generator) -> Indices:
    """The hair (n,) that guides each hair; about `hairs` have the same."""
    guides = rng.choice(len(roots), max(1, int(len(roots) / hairs)), replace=False)
    # Straight borders between locks would be visible.
    ragged = roots + 0.25 * np.sqrt(hairs / 400) * rng.normal(size=roots.shape)
    _, nearest = find_nearest(cKDTree(roots[guides]), ragged)
    return np.asarray(guides[nearest])


def _gathered(points: Float64Array, guide: Indices, locks: Locks, rng: np.random.Generator) -> Float64Array:
    """Hairs (n, points, 3) pulled to their guide hairs, more toward their tips; each lock is lifted a little."""
    roots = points[:, 0]
    t = np.linspace(0, 1, points.shape[1])
    apart = (roots - roots[guide])[:, None] * (1 - 0.75 * t)[None, :, None]
    looseness = np.clip(rng.uniform(0.35, 1.15, (len(points), 1, 1)), 0, 1)
    weight = locks.strength * looseness * (t**locks.onset)[None, :, None]
    height = locks.lift_cm * np.clip(rng.normal(size=len(points)), -0.6, 2)[guide]
    outward = unit(roots[guide] - _HEAD_MIDDLE) * height[:, None]
    goal = points[guide] + apart + outward[:, None] * t[None, :, None]
    return np.asarray(points + weight * (goal - points))


def curled(points: Float64Array, guide: Indices, curl: Curl, rng: np.random.Generator) -> Float64Array:
    """Hairs (n, points, 3) wound into helices, those with the same guide (n,) together; straight at the root."""
    count = len(points)
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
    along = np.concatenate([np.zeros((count, 1)), np.cumsum(steps, axis=1)], axis=1)
    ahead = unit(np.gradient(points, axis=1))
    across = unit(np.cross(ahead, [0.31, 0.17, 0.93]))
    phase = 6.28 * (rng.random(count)[guide] + curl.own * rng.normal(size=count))
    size = curl.radius_cm * rng.uniform(0.6, 1.3, count)[guide] * rng.uniform(0.8, 1.2, count)
    pitch = curl.pitch_cm * rng.uniform(0.75, 1.35, count)[guide]
    angle = 6.28 * along / pitch[:, None] + phase[:, None]
    radius = size[:, None] * np.clip(along / (1.2 * curl.pitch_cm), 0, 1) ** 1.3
    return np.asarray(
        points
        + (radius * np.cos(angle))[..., None] * across
        + (radius * np.sin(angle))[..., None] * np.cross(ahead, across)
    )


def frayed(
    points: Float64Array,
    length_cm: Float64Array,
    waviness_cm: float,
    waves: float,
    rng: np.random.Generator,
    out: float = 0.5,
) -> Float64Array:
    """Hairs with slight waves of their own and some strays; a few of those are flyaways, moved outward by `out`."""
    count = len(points)
    t = np.linspace(0, 1, points.shape[1])[None, :, None]
    phase, amount = 6.28 * rng.random((count, 1, 3)), rng.random((count, 1, 1))
    waved = points + waviness_cm * amount * t * np.sin(6.28 * waves * t + phase)
    stray = rng.random(count) < _STRAYS
    far = stray & (rng.random(count) < 0.35)
    outward = unit(waved[:, -1] - _HEAD_MIDDLE)[:, None]
    reach = np.minimum(length_cm, 8)[:, None, None] / 5
    drift = 0.45 * rng.normal(size=(count, 1, 3)) + far[:, None, None] * (
        out * outward + 0.3 * rng.normal(size=(count, 1, 3))
    )
    return np.asarray(waved + stray[:, None, None] * drift * reach * t**1.7)
