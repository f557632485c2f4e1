"""Triangle meshes: building blocks, Loop subdivision, vertex normals, smooth spreading of values over a surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from relit_camera.base.array_types import Float64Array

Triangles = NDArray[np.int64]
"""(count, 3) vertex indices, counter-clockwise seen from outside."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices (count, 3) float64 in centimeters, and triangles."""

    vertices: Float64Array
    triangles: Triangles


def grid_triangles(rows: int, columns: int, *, closed: bool = False, step: int = 1) -> Triangles:
    """Triangles of a rows x columns grid of vertices, row by row; `closed` joins the last column to the first.

    Seen from outside, columns run to the right and rows run down. With `step` only every so many vertices are used, the
    borders always: a coarser mesh of the same surface.
    """
    kept_rows, kept_columns = (np.unique(np.append(np.arange(0, n, step), n - 1)) for n in (rows, columns))
    index = (kept_rows[:, None] * columns + kept_columns).astype(np.int64)
    if closed:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    return np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])


def extrude(mesh: Mesh, rim: Sequence[int], rings: Sequence[Float64Array], *, cap: ArrayLike | None = None) -> Mesh:
    """Continue a hole's or border's rim of vertex indices by further rings (len(rim), 3), and close it at point `cap`.

    New vertices are appended ring by ring, the cap last. The rim may run either way round.
    """
    count, vertices, triangles = len(rim), [mesh.vertices], [mesh.triangles]
    half_edges = {tuple(edge) for edge in mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}
    forward = (rim[0], rim[1]) in half_edges
    inner = np.asarray(rim)
    for ring in rings:
        outer = len(mesh.vertices) + count * (len(vertices) - 1) + np.arange(count)
        vertices.append(ring)
        a, b, c, d = inner, np.roll(inner, -1), outer, np.roll(outer, -1)
        strip = np.concatenate([np.stack([b, a, c], 1), np.stack([b, c, d], 1)])
        triangles.append(strip if forward else strip[:, ::-1])
        inner = outer
    if cap is not None:
        center = np.full(count, len(mesh.vertices) + count * (len(vertices) - 1))
        vertices.append(np.asarray(cap, np.float64)[None])
        fan = np.stack([np.roll(inner, -1), inner, center], 1)
        triangles.append(fan if forward else fan[:, ::-1])
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))


def loop_subdivision(
    triangles: Triangles, count: int, sharp: Sequence[tuple[int, int]] = ()
) -> tuple[sparse.csr_array, Triangles, list[tuple[int, int]]]:
    """One step of Loop's subdivision (Loop 1987; creases after Hoppe et al. 1994) as a matrix.

    Args:
        triangles: of the coarse mesh.
        count: its vertices.
        sharp: edges that stay creases; borders do by themselves.

    Returns:
        The matrix (fine, coarse), its first `count` rows the coarse vertices; the fine triangles; the fine creases.
    """
    half = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    opposite = triangles[:, [2, 0, 1]].ravel()
    edges, which, uses = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    which = which.ravel()
    crease = uses == 1
    if sharp:
        crease |= (edges[:, None] == np.sort(np.asarray(sharp), axis=1)[None]).all(2).any(1)
    fine_of_edge = count + np.arange(len(edges))

    # New points: 3/8, 3/8, 1/8, 1/8 across a smooth edge; the middle of a crease.
    near = np.where(crease, 0.5, 0.375)
    smooth_corner = ~crease[which]
    entries = [
        (fine_of_edge, edges[:, 0], near),
        (fine_of_edge, edges[:, 1], near),
        (fine_of_edge[which][smooth_corner], opposite[smooth_corner], np.full(smooth_corner.sum(), 0.125)),
    ]
    # Old points: Warren's weights inside; 3/4, 1/8, 1/8 along a crease; corners, where creases meet or end, stay.
    creases_at = np.bincount(edges[crease].ravel(), minlength=count)
    valence = np.bincount(edges.ravel(), minlength=count)
    on_crease, inside = creases_at == 2, creases_at < 2
    beta = np.where(valence == 3, 3 / 16, 3 / (8 * np.maximum(valence, 1)))
    own = np.where(inside, 1 - valence * beta, np.where(on_crease, 0.75, 1.0))
    entries.append((np.arange(count), np.arange(count), own))
    for a, b in (edges.T, edges.T[::-1]):
        weight = np.where(inside[a], beta[a], np.where(on_crease[a] & crease, 0.125, 0.0))
        entries.append((a, b, weight))
    rows, columns, values = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    matrix = sparse.csr_array((values, (rows, columns)), shape=(count + len(edges), count))
    matrix.eliminate_zeros()

    middle = fine_of_edge[which].reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = triangles.T, middle.T
    fine = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    creased = np.flatnonzero(crease & (uses > 1))
    fine_sharp = [(int(e), int(fine_of_edge[i])) for i in creased for e in edges[i]]
    return matrix, fine, fine_sharp


def normal_operator(triangles: Triangles, count: int) -> sparse.csr_array:
    """Matrix (count, triangles) that sums the triangles' vectors at each vertex."""
    rows = triangles.T.ravel()
    columns = np.tile(np.arange(len(triangles)), 3)
    return sparse.csr_array((np.ones(rows.size, np.float32), (rows, columns)), shape=(count, len(triangles)))


def vertex_normals(vertices: NDArray, triangles: Triangles, operator: sparse.csr_array) -> NDArray:
    """Unit normals (count, 3), weighted by area, of the vertices' dtype; `operator` comes from `normal_operator`."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    summed = operator @ np.cross(b - a, c - a)
    return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12), vertices.dtype)


def spread(triangles: Triangles, count: int, fixed: Mapping[int, ArrayLike], order: int = 1) -> Float64Array:
    """Values (count, ...) interpolated smoothly from those given at the fixed vertices.

    Solves L^order x = 0 with the mesh's graph Laplacian: order 1 is harmonic and stays within the given values, order 2
    also joins without kinks.
    """
    half = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    adjacency = sparse.coo_array((np.ones(len(half)), half.T), shape=(count, count)).tocsr()
    adjacency = ((adjacency + adjacency.T) > 0).astype(np.float64)
    laplacian = sparse.csr_array(sparse.diags_array(adjacency.sum(axis=1)) - adjacency)
    operator = laplacian if order == 1 else laplacian @ laplacian
    known = np.fromiter(fixed, np.int64)
    values = np.array([fixed[index] for index in known.tolist()], np.float64)
    free = np.setdiff1d(np.arange(count), known)
    result = np.zeros((count, *values.shape[1:]))
    result[known] = values
    system = sparse.csc_array(operator[free][:, free])
    right = -(operator[free][:, known] @ values.reshape(len(known), -1))
    result[free] = np.asarray(spsolve(system, right)).reshape(free.size, *values.shape[1:])
    return result
