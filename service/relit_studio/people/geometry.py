"""Triangles, normals, samples and similarities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


def smoothstep(x: ArrayLike, low: float, high: float) -> Floats:
    """0 at `low`, 1 at `high` (which may be the smaller), smooth between."""
    t = np.clip((np.asarray(x, np.float64) - low) / (high - low), 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


def unit(vectors: ArrayLike) -> Floats:
    """Vectors (..., 3) at length 1; zero stays zero."""
    values = np.asarray(vectors, np.float64)
    return np.asarray(values / (np.linalg.norm(values, axis=-1, keepdims=True) + 1e-9))


def triangles_of(faces: NDArray) -> Indices:
    """Triangles (n, 3) of faces (m, 4) that hold -1 in their last column where they are triangles already."""
    quads = faces[faces[:, 3] >= 0]
    return np.concatenate([faces[:, :3], quads[:, [0, 2, 3]]]).astype(np.intp)


def vertices_of(faces: NDArray) -> Indices:
    """The vertices (n,) that faces (m, 4) use, in order; -1 is none."""
    return np.unique(faces[faces >= 0]).astype(np.intp)


def vertex_normals(vertices: Floats, triangles: Indices) -> Floats:
    """Unit normals (vertices, 3), weighted by area; zero where no triangle is."""
    flat = _crosses(vertices, triangles)
    summed = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(summed, triangles[:, corner], flat)
    return unit(summed)


def areas(vertices: Floats, triangles: Indices) -> Floats:
    """Area (n,) of each triangle."""
    return np.asarray(np.linalg.norm(_crosses(vertices, triangles), axis=1) / 2)


def _crosses(vertices: Floats, triangles: Indices) -> Floats:
    """A normal (n, 3) of each triangle, as long as twice its area."""
    corners = vertices[triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


class SurfacePoints(NamedTuple):
    """Points on a mesh that go with it: vertex indices (n, 3) and their weights (n, 3)."""

    corners: Indices
    weights: Floats

    def of(self, values: NDArray) -> Floats:
        """Values (n, k) at the points, of values (vertices, k); or (n,) of (vertices,)."""
        picked = np.asarray(values, np.float64)[self.corners]
        return np.asarray(np.einsum("nc,nc...->n...", self.weights, picked))


def scatter(triangles: Indices, density: Floats, count: int, rng: np.random.Generator) -> SurfacePoints:
    """`count` random points, triangles chosen in proportion to `density` (n,), uniform within each."""
    chosen = rng.choice(len(triangles), count, p=density / density.sum())
    first, second = rng.random((2, count))
    root = np.sqrt(first)
    return SurfacePoints(triangles[chosen], np.stack([1 - root, root * (1 - second), root * second], axis=1))


class Similarity(NamedTuple):
    """x ↦ scale · rotation x + offset."""

    scale: float
    rotation: Floats
    offset: Floats

    def apply(self, points: NDArray) -> Floats:
        """Move points (n, 3)."""
        return np.asarray(self.scale * points @ self.rotation.T + self.offset)

    def after(self, first: Similarity) -> Similarity:
        """`first`, then this."""
        return Similarity(
            self.scale * first.scale,
            self.rotation @ first.rotation,
            self.scale * self.rotation @ first.offset + self.offset,
        )


def fit_similarity(source: Floats, target: Floats) -> Similarity:
    """The similarity that takes points (n, 3) nearest to others (n, 3) in the least squares (Umeyama 1991)."""
    middle, goal = source.mean(axis=0), target.mean(axis=0)
    left, strength, right = np.linalg.svd((target - goal).T @ (source - middle))
    signs = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ signs @ right
    scale = float((strength * np.diag(signs)).sum() / ((source - middle) ** 2).sum())
    return Similarity(scale, rotation, goal - scale * rotation @ middle)


def find_nearest(tree: cKDTree, points: Floats, count: int = 1) -> tuple[Floats, Indices]:
    """Distance and index of the tree's nearest point to each of some points (n, k): (n,), or (n, count) of several."""
    distance, index = tree.query(points, k=count)
    return np.asarray(distance), np.asarray(index)


def neighbour_mean(values: Floats, pairs: Indices) -> tuple[Floats, NDArray[np.bool_]]:
    """Mean (n, k) over each vertex's neighbours in `pairs` (m, 2), and (n,) which vertices have any."""
    summed, count = np.zeros_like(values), np.zeros(len(values))
    np.add.at(summed, pairs[:, 0], values[pairs[:, 1]])
    np.add.at(count, pairs[:, 0], 1)
    return summed / np.maximum(count, 1)[:, None], count > 0


def edges_of(triangles: Indices) -> Indices:
    """Both directions (m, 2) of every triangle's edges; an edge of two triangles comes twice."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.concatenate([edges, edges[:, ::-1]])
