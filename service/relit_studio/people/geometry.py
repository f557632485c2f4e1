"""Mesh geometry: triangles, normals, random surface points and similarity transforms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array, Indices


def unit(vectors: ArrayLike) -> Float64Array:
    """Vectors (..., 3) scaled to length 1; zero vectors stay zero."""
    values = np.asarray(vectors, np.float64)
    return np.asarray(values / (np.linalg.norm(values, axis=-1, keepdims=True) + 1e-9))


def triangles_of(faces: NDArray) -> Indices:
    """Triangles (n, 3) of faces (m, 4) that hold -1 in their last column where they are triangles already."""
    quads = faces[faces[:, 3] >= 0]
    return np.concatenate([faces[:, :3], quads[:, [0, 2, 3]]]).astype(np.intp)


def vertices_of(faces: NDArray) -> Indices:
    """Sorted indices (n,) of the vertices that faces (m, 4) use; -1 means no vertex."""
    return np.unique(faces[faces >= 0]).astype(np.intp)


def vertex_normals(vertices: Float64Array, triangles: Indices) -> Float64Array:
    """Unit normals (vertices, 3), weighted by area; zero where no triangle is."""
    flat = _crosses(vertices, triangles)
    summed = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(summed, triangles[:, corner], flat)
    return unit(summed)


def areas(vertices: Float64Array, triangles: Indices) -> Float64Array:
    """Area (n,) of each triangle."""
    return np.asarray(np.linalg.norm(_crosses(vertices, triangles), axis=1) / 2)


def _crosses(vertices: Float64Array, triangles: Indices) -> Float64Array:
    """Normal (n, 3) of each triangle, with twice its area as length."""
    corners = vertices[triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


class SurfacePoints(NamedTuple):
    """Points attached to a mesh by barycentric coordinates: vertex indices (n, 3) and weights (n, 3)."""

    corners: Indices
    weights: Float64Array

    def interpolate(self, values: NDArray) -> Float64Array:
        """Values (n, k) at the points, of values (vertices, k); or (n,) of (vertices,)."""
        picked = np.asarray(values, np.float64)[self.corners]
        return np.asarray(np.einsum("nc,nc...->n...", self.weights, picked))


def scatter(triangles: Indices, density: Float64Array, count: int, rng: np.random.Generator) -> SurfacePoints:
    """`count` random points, triangles chosen in proportion to `density` (n,), uniform within each."""
    chosen = rng.choice(len(triangles), count, p=density / density.sum())
    first, second = rng.random((2, count))
    root = np.sqrt(first)
    return SurfacePoints(triangles[chosen], np.stack([1 - root, root * (1 - second), root * second], axis=1))


class Similarity(NamedTuple):
    """Similarity transform x ↦ scale · rotation x + offset."""

    scale: float
    rotation: Float64Array
    offset: Float64Array

    def apply(self, points: NDArray) -> Float64Array:
        """Move points (n, 3)."""
        return np.asarray(self.scale * points @ self.rotation.T + self.offset)

    def after(self, first: Similarity) -> Similarity:
        """Composition: `first`, then this transform."""
        return Similarity(
            self.scale * first.scale,
            self.rotation @ first.rotation,
            self.scale * self.rotation @ first.offset + self.offset,
        )


def fit_similarity(source: Float64Array, target: Float64Array) -> Similarity:
    """Least-squares similarity transform from points (n, 3) to other points (n, 3) (Umeyama 1991)."""
    middle, goal = source.mean(axis=0), target.mean(axis=0)
    left, strength, right = np.linalg.svd((target - goal).T @ (source - middle))
    signs = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ signs @ right
    scale = float((strength * np.diag(signs)).sum() / ((source - middle) ** 2).sum())
    return Similarity(scale, rotation, goal - scale * rotation @ middle)


def find_nearest(tree: cKDTree, points: Float64Array, count: int = 1) -> tuple[Float64Array, Indices]:
    """Distance and index of the tree's nearest point for each point (n, k): (n,), or (n, count) for several."""
    distance, index = tree.query(points, k=count)
    return np.asarray(distance), np.asarray(index)


def neighbor_mean(values: Float64Array, pairs: Indices) -> tuple[Float64Array, NDArray[np.bool_]]:
    """Mean (n, k) over each vertex's neighbors in `pairs` (m, 2), and (n,) which vertices have any."""
    summed, count = np.zeros_like(values), np.zeros(len(values))
    np.add.at(summed, pairs[:, 0], values[pairs[:, 1]])
    np.add.at(count, pairs[:, 0], 1)
    return summed / np.maximum(count, 1)[:, None], count > 0


def edges_of(triangles: Indices) -> Indices:
    """Both directions (m, 2) of every triangle's edges; an edge of two triangles comes twice."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.concatenate([edges, edges[:, ::-1]])
