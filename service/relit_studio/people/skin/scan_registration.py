"""Registration of the face model to the scan, so that every identity can use its photographed skin.

The model's eyes are closed like the scan's, so that lids get the right texture in blinks and smiles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array, Indices
from relit_studio.people.face.face_model import IDENTITIES, FaceModel, Part
from relit_studio.people.geometry import (
    Similarity,
    areas,
    edges_of,
    find_nearest,
    fit_similarity,
    neighbor_mean,
    scatter,
    unit,
    vertex_normals,
)
from relit_studio.people.skin.head_scan import Scan

_PICKED = np.array(
    [
        (30, -0.07, 1.10), (36, -1.05, 1.67), (39, -0.39, 1.71), (42, 0.21, 1.71), (45, 0.88, 1.68), (48, -0.52, 0.41),
        (54, 0.40, 0.41), (51, -0.07, 0.60), (57, -0.07, 0.30), (33, -0.07, 0.90), (27, -0.07, 1.82), (8, -0.07, -0.41),
    ]
)  # fmt: skip
"""iBUG point, and where it lies on the scan seen from the front (x, y in the scan's unit), picked by eye."""
LANDMARKS = _PICKED[:, 0].astype(int)
"""The iBUG points that guide the fit."""
_ROUNDS = 24
_RIDGE = 15.0
_NORMAL_WEIGHT = 1.2
"""Weight of normals in the search for the nearest scan point: half the centimeters that opposite normals count."""
_SMOOTHINGS = 6
_SEAM = 0.06
"""Neighboring vertices with texture coordinates farther apart than this lie on both sides of a seam."""
_NECK_END_CM = -11.0


@dataclass(frozen=True, eq=False)
class Registration:
    """The scan registered to the face model.

    Attributes:
        uv: (model vertices, 2) the scan's texture coordinate at each vertex of the skin, v up; 0 elsewhere.
        body: (scan vertices, 3) the scan in the model's axes and unit.
        mean_distance_cm: mean distance of the fitted surfaces.
    """

    uv: Float64Array
    body: Float64Array
    mean_distance_cm: float


@dataclass(frozen=True, eq=False)
class _Samples:
    points: Float64Array
    normals: Float64Array
    uv: Float64Array

    def moved(self, similarity: Similarity) -> _Samples:
        return _Samples(similarity.apply(self.points), self.normals @ similarity.rotation.T, self.uv)


def register(model: FaceModel, scan: Scan, samples: int = 1_500_000) -> Registration:
    """Fit identity and similarity in turn (point-to-plane ICP, 24 rounds), then look up texture coordinates."""
    cloud = _sample(scan, samples, np.random.default_rng(1))
    closed = model.vertices + model.displacement({"eyeBlink_L": 1, "eyeBlink_R": 1})
    similarity, mesh, distance = fit(model, closed, cloud.points, cloud.normals, _landmark_targets(cloud))
    uv = _texture_coordinates(model, mesh, cloud.moved(similarity))
    return Registration(uv, similarity.apply(scan.vertices), distance)


def fit(
    model: FaceModel,
    start: Float64Array,
    points: Float64Array,
    normals: Float64Array,
    targets: Float64Array,
    rounds: int = _ROUNDS,
) -> tuple[Similarity, Float64Array, float]:
    """Fit the model to a cloud.

    Args:
        model: whose identities may be used.
        start: (vertices, 3) of the mean identity in the cloud's expression.
        points: (n, 3) of the cloud, in any similar frame.
        normals: (n, 3) of the cloud.
        targets: (12, 3) the landmarks of this module, in the cloud's frame.
        rounds: of the iteration.

    Returns:
        Similarity transform from cloud to model; the fitted vertices; and the mean distance that is left.
    """
    skin = model.triangles(Part.FACE, Part.HEAD)
    used = np.flatnonzero((model.vertex_part <= Part.HEAD) & (start[:, 1] > _NECK_END_CM))
    landmarks = model.landmarks68[LANDMARKS]
    basis = model.identities.astype(np.float32)
    basis_landmarks = basis[:, landmarks].reshape(IDENTITIES, -1).T
    similarity = fit_similarity(targets, start[landmarks])
    mesh, distance = start, np.inf
    for step in range(rounds):
        placed, turned, goal = similarity.apply(points), normals @ similarity.rotation.T, similarity.apply(targets)
        gap, nearest = find_nearest(cKDTree(placed), mesh[used])
        facing = (vertex_normals(mesh, skin)[used] * turned[nearest]).sum(axis=1) > 0.6
        accepted = facing & (gap < max(3 - 0.12 * step, 0.8))
        distance = float(gap[accepted].mean())
        vertices, matched = used[accepted], nearest[accepted]
        plane = turned[matched]
        matrix = np.einsum("kni,ni->nk", basis[:, vertices], plane)
        residual = ((placed[matched] - start[vertices]) * plane).sum(axis=1)
        weight = 60 if step < rounds // 2 else 25
        normal_matrix = matrix.T @ matrix + weight * basis_landmarks.T @ basis_landmarks + _RIDGE * np.eye(IDENTITIES)
        right_side = matrix.T @ residual + weight * basis_landmarks.T @ (goal - start[landmarks]).ravel()
        mesh = start + np.tensordot(np.linalg.solve(normal_matrix, right_side), basis, 1)
        better = fit_similarity(
            np.concatenate([placed[matched], np.repeat(goal, 40, axis=0)]),
            np.concatenate([mesh[vertices], np.repeat(mesh[landmarks], 40, axis=0)]),
        )
        similarity = better.after(similarity)
    return similarity, mesh, distance


def _sample(scan: Scan, count: int, rng: np.random.Generator) -> _Samples:
    where = scatter(scan.triangles, areas(scan.vertices, scan.triangles), count, rng)
    normals = where.interpolate(vertex_normals(scan.vertices, scan.triangles))
    return _Samples(where.interpolate(scan.vertices), normals, where.interpolate(scan.uv))


def _landmark_targets(cloud: _Samples) -> Float64Array:
    """The picked points (12, 3) on the scan, at the foremost surface near each."""
    front = cloud.points[cloud.normals[:, 2] > 0.1]
    picked = _PICKED[:, 1:]
    _, near = find_nearest(cKDTree(front[:, :2]), picked, 25)
    return np.column_stack([picked, front[near, 2].max(axis=1)])


def _texture_coordinates(model: FaceModel, mesh: Float64Array, cloud: _Samples) -> Float64Array:
    """Texture coordinates of the nearest scan point with a similar normal, smoothed over the mesh."""
    triangles = model.triangles(Part.FACE, Part.HEAD)
    skin = np.flatnonzero(model.vertex_part <= Part.HEAD)
    normals = unit(vertex_normals(mesh, triangles))
    tree = cKDTree(np.hstack([cloud.points, _NORMAL_WEIGHT * cloud.normals]))
    _, nearest = find_nearest(tree, np.hstack([mesh[skin], _NORMAL_WEIGHT * normals[skin]]))
    uv = np.zeros((len(mesh), 2))
    uv[skin] = cloud.uv[nearest]
    edges: Indices = edges_of(triangles)
    for _ in range(_SMOOTHINGS):
        same_island = np.linalg.norm(uv[edges[:, 0]] - uv[edges[:, 1]], axis=1) < _SEAM
        mean, has = neighbor_mean(uv, edges[same_island])
        uv[has] = 0.5 * (uv[has] + mean[has])
    return uv
