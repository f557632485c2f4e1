"""Hair drawn back to a knot, and what hangs or lies there: a ponytail or a bun."""

from __future__ import annotations

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_studio.people.geometry import unit
from relit_studio.people.hair.scalp import Obstacle, Roots

KNOTS = {"ponytail": np.array([0.0, 8.6, -9.0]), "bun": np.array([0.0, 16.0, -3.6])}
"""Position of the knot on the mean head, by hair style."""
POINTS = 30
_CENTER = np.array([0.0, 4.0, -0.5])
_BUN_CM = 3.5


def drawn_back(roots: Roots, knot: Float64Array, obstacle: Obstacle, rng: np.random.Generator) -> Float64Array:
    """Polylines (n, 30, 3) over the head from each root to the knot."""
    count = len(roots.place)
    offset, goal = roots.place - _CENTER, knot - _CENTER
    reach, goal_reach = np.linalg.norm(offset, axis=1), float(np.linalg.norm(goal))
    start, end = offset / reach[:, None], np.tile(goal / goal_reach, (count, 1))
    angle = np.arccos(np.clip((start * end).sum(axis=1), -0.999, 0.999))[:, None]
    layer = 0.2 + 0.75 * rng.random(count)
    slack = 0.35 * rng.normal(size=(count, 3))
    places = []
    for t in np.linspace(0, 1, POINTS):
        # Along the great circle, as a brush moves.
        direction = (np.sin((1 - t) * angle) * start + np.sin(t * angle) * end) / np.sin(angle)
        place = _CENTER + direction * ((1 - t) * reach + t * goal_reach)[:, None] + slack * np.sin(np.pi * t)
        surface, normal = obstacle.nearest(place)
        gap = ((place - surface) * normal).sum(axis=1)
        wanted = layer * min(1.0, 6 * t) + 0.9 * smoothstep(t, 0.75, 1.0)
        lifted = place + normal * np.clip(wanted - gap, -0.8 * min(1.0, 4 * t), None)[:, None]
        loose = float(smoothstep(t, 0.8, 1.0))
        places.append(lifted * (1 - loose) + (knot + 0.35 * slack) * loose)
    places[0] = roots.place
    return np.stack(places, axis=1)


def tail(knot: Float64Array, obstacle: Obstacle, count: int, rng: np.random.Generator) -> Float64Array:
    """Polylines (count, 30, 3) of a ponytail: out of the knot, and down toward one shoulder."""
    side = 1.0 if rng.random() < 0.5 else -1.0
    around = 6.28 * rng.random(count)
    spread = np.sqrt(rng.random(count))[:, None]
    disc = np.stack([np.cos(around), np.sin(around), np.zeros(count)], axis=1) * spread
    place = knot + 0.6 * disc
    direction = unit(np.array([0.9 * side, 0.25, -0.8]) + 0.45 * disc)
    length = rng.uniform(17, 25, count)
    places = [place]
    for index in range(1, POINTS):
        t = index / (POINTS - 1)
        # Over the shoulder, where it is visible.
        ahead = np.array([0.07 * side, -0.22, 0.16 * smoothstep(t, 0.2, 0.6)])
        direction = unit(direction + ahead + 0.03 * disc * (1 - 1.6 * t))
        place = place + direction * (length / (POINTS - 1))[:, None]
        surface, normal = obstacle.nearest(place)
        gap = ((place - surface) * normal).sum(axis=1)
        place = place + normal * np.clip(0.5 - gap, 0, 1.5)[:, None]
        places.append(place)
    return np.stack(places, axis=1)


def bun(knot: Float64Array, count: int, rng: np.random.Generator) -> Float64Array:
    """Polylines (count, 30, 3) wound about a ball over the knot."""
    up = unit(knot - _CENTER)
    aside = unit(np.cross(up, [0, 0, 1]))
    ahead = np.cross(aside, up)
    strand = rng.integers(7, size=count)
    tube = rng.random((2, count))
    start = 6.28 * (strand / 7 + 0.03 * rng.normal(size=count))
    t = np.linspace(0, 1, POINTS)[None]
    turn = start[:, None] + 6.28 * 0.8 * t
    # A rope along a ring: strands twist around each other.
    twist = 6.28 * (tube[0][:, None] * 0.35 + strand[:, None] * 0.37 + 0.9 * t)
    thick = 0.55 * _BUN_CM * np.sqrt(tube[1])[:, None] ** 0.3
    radius = 0.52 * _BUN_CM + thick * np.cos(twist)
    height = 0.45 * _BUN_CM + 1.1 * thick * np.sin(twist)
    flat = radius[..., None] * (np.cos(turn)[..., None] * aside + np.sin(turn)[..., None] * ahead)
    return np.asarray(knot + flat + height[..., None] * up)
