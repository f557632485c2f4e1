"""Positions of the canonical face's vertices (scheme mesh478) on the face model.

The canonical face is warped onto the mean head by a thin-plate spline through the landmarks that both have, then moved
to the nearest skin. Lids and lips, where skin lies close to skin, follow the model's own edges instead.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import sparse
from scipy.interpolate import RBFInterpolator
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.face.landmarks.landmark_schemes import VERTICES_66, landmark_scheme
from relit_studio.people.face.face_model import FaceModel, Part
from relit_studio.people.geometry import SurfacePoints, edges_of, find_nearest

IBUG_66 = np.delete(np.arange(68), (48, 54))
"""The iBUG points of scheme openseeface66: all but the outer mouth corners."""
_SKIN_POINTS = 468
_CANDIDATES = 24
"""Number of nearby triangles that are searched for the nearest point."""


@lru_cache(maxsize=1)
def mesh_points(model: FaceModel) -> SurfacePoints:
    """The 468 skin points, attached to the model's mesh."""
    canonical = landmark_scheme("mesh478").canonical[:_SKIN_POINTS]
    bend = RBFInterpolator(
        canonical[list(VERTICES_66)], model.vertices[model.landmarks68[IBUG_66]], kernel="thin_plate_spline"
    )
    laid = nearest_on_surface(bend(canonical), model.vertices, model.triangles(Part.FACE))
    for points, ibug in _contours():
        edge = _along_edge(model, canonical[list(points)], model.landmarks68[list(ibug)].astype(np.intp))
        laid.corners[list(points)], laid.weights[list(points)] = edge.corners, edge.weights
    return laid


def nearest_on_surface(points: Float64Array, vertices: Float64Array, triangles: Indices) -> SurfacePoints:
    """Nearest point on a mesh for each point (n, 3)."""
    middles = vertices[triangles].mean(axis=1)
    _, near = find_nearest(cKDTree(middles), points, min(_CANDIDATES, len(triangles)))
    corners = vertices[triangles[near]]
    weights = _clamped_weights(points[:, None], corners)
    placed = np.einsum("nkc,nkcd->nkd", weights, corners)
    best = np.argmin(np.linalg.norm(placed - points[:, None], axis=-1), axis=1)
    rows = np.arange(len(points))
    return SurfacePoints(triangles[near[rows, best]], weights[rows, best])


def _clamped_weights(points: Float64Array, corners: Float64Array) -> Float64Array:
    """Barycentric weights (..., 3) of the feet of perpendiculars on triangles (..., 3, 3), cut off at the edges.

    The cut is not the exact nearest point where the foot lies outside; some other triangle then has a nearer one.
    """
    first, second = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    offset = points - corners[..., 0, :]
    a, b, c = (first * first).sum(-1), (first * second).sum(-1), (second * second).sum(-1)
    d, e = (offset * first).sum(-1), (offset * second).sum(-1)
    determinant = np.maximum(a * c - b * b, 1e-12)
    v, w = (c * d - b * e) / determinant, (a * e - b * d) / determinant
    weights = np.clip(np.stack([1 - v - w, v, w], axis=-1), 0, None)
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def _contours() -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Points of mesh478 along an edge, and the iBUG points along the same edge from end to end."""
    scheme = landmark_scheme("mesh478")
    right, left = scheme.right_eye.lids, scheme.left_eye.lids
    return [
        (right[:9], (36, 37, 38, 39)),
        ((right[0], *right[:7:-1]), (36, 41, 40, 39)),
        (left[:9], (45, 44, 43, 42)),
        ((left[0], *left[:7:-1]), (45, 46, 47, 42)),
        (scheme.upper_lip_outer, (48, 49, 50, 51, 52, 53, 54)),
        (scheme.lower_lip_outer, (48, 59, 58, 57, 56, 55, 54)),
        (scheme.upper_lip_inner, (60, 61, 62, 63, 64)),
        (scheme.lower_lip_inner, (60, 67, 66, 65, 64)),
    ]


def _along_edge(model: FaceModel, points: Float64Array, through: Indices) -> SurfacePoints:
    """Points (n, 3) of a curve, placed at the same relative arc lengths on the model's edge `through` some vertices."""
    path = _path(model, through)
    fraction, lengths = _fractions(points), _fractions(model.vertices[path])
    before = np.clip(np.searchsorted(lengths, fraction, side="right") - 1, 0, len(path) - 2)
    part = np.clip((fraction - lengths[before]) / (lengths[before + 1] - lengths[before]), 0, 1)
    corners = np.stack([path[before], path[before + 1], path[before + 1]], axis=1)
    return SurfacePoints(corners, np.stack([1 - part, part, np.zeros_like(part)], axis=1))


def _path(model: FaceModel, through: Indices) -> Indices:
    """Shortest path (k,) along the edges of the model's faces through these vertices."""
    faces = model.faces[model.face_part == Part.FACE]
    quads = faces[faces[:, 3] >= 0]
    sides = np.concatenate([quads[:, [0, 1]], quads[:, [1, 2]], quads[:, [2, 3]], quads[:, [3, 0]]])
    sides = np.concatenate([sides, edges_of(faces[faces[:, 3] < 0, :3])])
    # Sides shared by two faces occur twice.
    first, second = np.unique(np.sort(sides, axis=1), axis=0).T
    length = np.linalg.norm(model.vertices[first] - model.vertices[second], axis=1)
    graph = sparse.coo_array((length, (first, second)), (len(model.vertices),) * 2).tocsr()
    _, came_from = dijkstra(graph, directed=False, indices=through[:-1], return_predecessors=True)
    path = [int(through[0])]
    for leg, goal in enumerate(through[1:]):
        way = [int(goal)]
        while way[-1] != through[leg]:
            way.append(int(came_from[leg, way[-1]]))
        path += way[-2::-1]
    return np.array(path, np.intp)


def _fractions(points: Float64Array) -> Float64Array:
    """Fraction of a polyline's length at each of its points, 0..1."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.asarray(np.concatenate([[0], np.cumsum(steps)]) / steps.sum())
