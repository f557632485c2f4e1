"""Crew-neck shirt: the scan's shoulders moved outward and cut by a tilted plane, with a collar at the cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.easing import smoothstep
from relit_studio.people.clothing.collar import fold_collar
from relit_studio.people.geometry import edges_of, find_nearest, neighbor_mean, unit, vertex_normals
from relit_studio.people.traits.person_traits import Neckline

_POINT = np.array([0.0, -11.3, -1.5])
_NORMAL = unit([0.0, 1.0, 0.40])
"""The plane of the neckline."""
_LOW_CM = -8.5
"""Height below which the scan may become cloth."""
_GAP_CM = 0.45
"""Least distance of the cloth from the skin."""
_COLLAR_SECTIONS, _COLLAR_POINTS = 96, 12


@dataclass(frozen=True, eq=False)
class Shirt:
    """Cloth and collar.

    Attributes:
        cloth, cloth_faces: (n, 3) and (m, 4), -1 in the last column.
        collar, collar_faces: (k, 3) and (l, 4).
        covered: (vertices,) what of the face model's skin lies under it.
        under: vertices and faces of the collar of a shirt worn below, or None.
    """

    cloth: Float64Array
    cloth_faces: Indices
    collar: Float64Array
    collar_faces: Indices
    covered: NDArray[np.bool_]
    under: tuple[Float64Array, Indices] | None = None


def sew_shirt(
    body: Float64Array, triangles: Indices, skin: Float64Array, skin_triangles: Indices, neckline: Neckline = "crew"
) -> Shirt:
    """A shirt from the scan's surface over the skin of one identity."""
    body = body + [-body[body[:, 1] < -14, 0].mean(), 0, 0]
    body = body + 0.5 * vertex_normals(body, triangles)
    low = body[:, 1] < _LOW_CM
    cloth = _fitted(body, triangles, low, skin, skin_triangles)
    height = (cloth - _POINT) @ _NORMAL
    kept = (height[triangles].min(axis=1) < 0.2) & low[triangles].all(axis=1)
    cloth = cloth - (np.clip(height - 0.2, 0, None) * low)[:, None] * _NORMAL
    # Sleeves hang farther down than the scan reaches.
    cloth[:, 1] = np.where(cloth[:, 1] < -13, -13 + 1.45 * (cloth[:, 1] + 13), cloth[:, 1])

    neck = skin[np.unique(skin_triangles)]
    middle, outward = _neckline(neck, 70)
    collar = _collar(middle, outward)
    _, nearest = find_nearest(cKDTree(middle), cloth)
    fraction = 0.9 * smoothstep((cloth - _POINT) @ _NORMAL, -3, 0) * low
    cloth = cloth + fraction[:, None] * (middle[nearest] - cloth) * [1, 0.4, 1]
    faces = np.column_stack([triangles[kept], np.full(int(kept.sum()), -1)])
    covered = (skin - _POINT) @ _NORMAL < -0.5
    under = None
    if neckline == "collar":
        under = fold_collar(
            _neckline(neck, 25)[0], _NORMAL, np.concatenate([cloth[np.unique(triangles[kept])], collar])
        )
    return Shirt(cloth, faces, collar, _tube_faces(), covered, under)


def _fitted(
    body: Float64Array, triangles: Indices, low: NDArray[np.bool_], skin: Float64Array, skin_triangles: Indices
) -> Float64Array:
    """The body smoothed, and kept outside the skin."""
    normals = vertex_normals(skin, skin_triangles)
    near = np.unique(skin_triangles)
    near = near[skin[near, 1] < -8]
    tree, edges = cKDTree(skin[near]), edges_of(triangles)
    cloth = body
    for _ in range(14):
        mean, has = neighbor_mean(cloth, edges)
        cloth = cloth + 0.35 * (low & has)[:, None] * (mean - cloth)
        distance, index = find_nearest(tree, cloth)
        normal = normals[near[index]]
        gap = ((cloth - skin[near[index]]) * normal).sum(axis=1)
        push = np.where((distance < 5) & low, np.clip(_GAP_CM - gap, 0, None), 0)
        cloth = cloth + normal * push[:, None]
    return cloth


def _neckline(skin: Float64Array, percentile: float) -> tuple[Float64Array, Float64Array]:
    """Neckline (96, 3) in its plane, outside the given percentile of the skin, and outward unit vectors (96, 3)."""
    neck = skin[(skin[:, 1] < -8) & (np.abs((skin - _POINT) @ _NORMAL) < 1.4)]
    center = np.array([neck[:, 0].mean(), _POINT[1], (neck[:, 2].min() + neck[:, 2].max()) / 2])
    offset = neck - center
    angle, radius = np.arctan2(offset[:, 0], offset[:, 2]), np.hypot(offset[:, 0], offset[:, 2])
    around = np.linspace(-np.pi, np.pi, _COLLAR_SECTIONS, endpoint=False)
    apart = np.abs((angle[None] - around[:, None] + np.pi) % (2 * np.pi) - np.pi)
    wide = np.array([np.percentile(radius[row < 0.25], percentile) for row in apart])
    for _ in range(6):
        wide = (np.roll(wide, 1) + wide + np.roll(wide, -1)) / 3
    outward = np.stack([np.sin(around), np.zeros_like(around), np.cos(around)], axis=1)
    middle = center + outward * (wide + 0.38)[:, None]
    middle[:, 1] = _POINT[1] - (middle - _POINT)[:, 2] * _NORMAL[2] / _NORMAL[1]
    return middle, outward


def _collar(middle: Float64Array, outward: Float64Array) -> Float64Array:
    """A rolled tube (96 · 12, 3) about the neckline."""
    section = np.linspace(0, 2 * np.pi, _COLLAR_POINTS, endpoint=False)
    sideways, upward = 0.30 * np.cos(section) - 0.45 * np.sin(section), 1.05 * np.sin(section) - 0.3
    tube = middle[:, None] + outward[:, None] * sideways[None, :, None] + _NORMAL * upward[None, :, None]
    return tube.reshape(-1, 3)


def _tube_faces() -> Indices:
    section, point = np.mgrid[0:_COLLAR_SECTIONS, 0:_COLLAR_POINTS]
    following, beside = (section + 1) % _COLLAR_SECTIONS, (point + 1) % _COLLAR_POINTS
    corners = [(section, point), (section, beside), (following, beside), (following, point)]
    return np.stack([(s * _COLLAR_POINTS + p).ravel() for s, p in corners], axis=1)
