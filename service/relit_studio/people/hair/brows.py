"""Eyebrows: hairs along the brow's landmarks, thinner toward its edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array
from relit_studio.people.face.face_model import FaceModel, Part
from relit_studio.people.geometry import SurfacePoints, areas, find_nearest, scatter, unit, vertex_normals
from relit_studio.people.hair.hair_strands import Hairs, concatenate_hairs
from relit_studio.people.traits.person_traits import BrowTraits

_BROWS = ((-1, tuple(range(17, 22))), (1, tuple(range(26, 21, -1))))
"""For each brow the direction of its tail along X, and its landmarks from tail to inner end."""
_STEPS = 60
_POINTS = 5
_REACH = 1.7
"""Largest distance of a hair from the middle line, in widths; hairs get fewer toward it."""


@dataclass(frozen=True, eq=False)
class _Roots:
    """Hair roots on the mesh, with position along the brow (0 tail, 1 inner end) and across it (1 above, -1 below)."""

    surface: SurfacePoints
    along: Float64Array
    across: Float64Array


def grow_brows(model: FaceModel, neutral: Float64Array, vertices: Float64Array, seed: int, traits: BrowTraits) -> Hairs:
    """Brows rooted on the `neutral` head, posed on the head with `vertices` in any expression."""
    rng = np.random.default_rng(seed + 200)
    triangles = model.triangles(Part.FACE)
    normals = vertex_normals(vertices, triangles)
    grown = []
    for side, landmarks in _BROWS:
        line = _middle_line(neutral[model.landmarks68[list(landmarks)]], traits.flatness)
        roots = _scatter_roots(neutral, triangles, line, traits, rng)
        grown.append(_hairs(roots, side, vertices, normals, traits, rng))
    return concatenate_hairs(grown)


def _middle_line(landmarks: Float64Array, flatness: float) -> Float64Array:
    """Middle line (60, 3) of a brow from tail to inner end."""
    points = landmarks - [0, 0.35, 0]
    straight = np.polyval(np.polyfit(points[:, 0], points[:, 1], 1), points[:, 0])
    points[:, 1] += flatness * (straight - points[:, 1])
    # The line through the landmarks alone gives a sad face.
    points[:, 1] += np.linspace(0.12, -0.33, 5)
    place = np.linspace(0, 1, 5)
    line = np.stack([np.interp(np.linspace(0, 1, _STEPS), place, points[:, axis]) for axis in range(3)], axis=1)
    line[1:-1] = (line[:-2] + line[1:-1] + line[2:]) / 3
    return np.asarray(line)


def _scatter_roots(
    neutral: Float64Array, triangles: np.ndarray, line: Float64Array, traits: BrowTraits, rng: np.random.Generator
) -> _Roots:
    tree = cKDTree(line[:, :2])
    middles = neutral[triangles].mean(axis=1)
    distance, _ = find_nearest(tree, middles[:, :2])
    near = triangles[(distance < 0.45 * traits.width * _REACH + 0.35) & (middles[:, 2] > 5)]
    drawn = scatter(near, areas(neutral, near), traits.hairs * 16, rng)
    place = drawn.interpolate(neutral)
    distance, nearest = find_nearest(tree, place[:, :2])
    along = nearest / (_STEPS - 1)
    half_width = traits.width * np.interp(along, [0, 0.25, 0.7, 0.95, 1], [0.06, 0.2, 0.32, 0.3, 0.2])
    # Soft edges: density falls off as a bell curve across, and toward both ends.
    ends = np.interp(along, [0, 0.12, 0.75, 0.93, 1], [0.3, 1, 1, 0.55, 0.1])
    chance = ends * np.exp(-1.9 * (distance / half_width) ** 2)
    kept = np.flatnonzero((rng.random(len(along)) < chance) & (distance < _REACH * half_width))[: traits.hairs]
    across = (place[kept, 1] - line[nearest[kept], 1]) / half_width[kept]
    return _Roots(SurfacePoints(drawn.corners[kept], drawn.weights[kept]), along[kept], across)


def _hairs(
    roots: _Roots,
    side: int,
    vertices: Float64Array,
    normals: Float64Array,
    traits: BrowTraits,
    rng: np.random.Generator,
) -> Hairs:
    count, along, across = len(roots.along), roots.along, np.clip(roots.across, -1.3, 1.3)
    start, normal = roots.surface.interpolate(vertices), unit(roots.surface.interpolate(normals))
    outward = np.tile([float(side), 0.0, 0.0], (count, 1))
    rise = np.clip(np.interp(along, [0, 0.4, 0.75, 1], [-0.25, 0.0, 0.45, 1.3]) - 0.45 * across, -0.8, 1.6)
    direction = outward + rise[:, None] * [0, 1, 0] + 0.24 * rng.normal(size=(count, 3))
    direction = unit(direction - (direction * normal).sum(axis=1, keepdims=True) * normal) + 0.28 * normal
    faint = np.exp(-0.5 * across**2)
    length = traits.length_cm * rng.uniform(0.5, 1.1, count) * (0.6 + 0.4 * faint)
    length *= np.interp(along, [0, 0.2, 1], [0.7, 1, 0.8])
    t = np.linspace(0, 1, _POINTS)[:, None]
    bend = 0.35 * outward - 0.6 * np.sign(across)[:, None] * np.array([0, 0.25, 0])
    offset = direction[:, None] * t + (0.5 * bend - 0.22 * normal)[:, None] * t**2
    points = start[:, None] + offset * length[:, None, None]
    thick = 0.0058 * traits.thickness * (0.55 + 0.45 * faint) * rng.uniform(0.75, 1.1, count)
    return Hairs(points, thick[:, None] * np.linspace(1, 0.3, _POINTS), 0.5 * rng.normal(size=count))
