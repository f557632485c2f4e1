"""Triangles, samples and similarities against truth that is known otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relit_camera.base.easing import smoothstep
from relit_studio.people.face.mesh478_points import nearest_on_surface
from relit_studio.people.geometry import (
    Similarity,
    areas,
    fit_similarity,
    neighbor_mean,
    scatter,
    triangles_of,
    vertex_normals,
)

SQUARE = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [1, 3, 0]])
FACES = np.array([[0, 1, 2, 3], [3, 2, 4, -1]])


def test_quads_are_halved_and_triangles_kept() -> None:
    triangles = triangles_of(FACES)
    assert len(triangles) == 3
    assert areas(SQUARE, triangles).sum() == 2 + 2
    np.testing.assert_allclose(vertex_normals(SQUARE, triangles), np.tile([0, 0, 1], (5, 1)), atol=1e-8)


def test_a_similarity_is_found_again() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(20, 3))
    truth = Similarity(2.5, Rotation.from_euler("YXZ", [40, -20, 100], degrees=True).as_matrix(), np.array([1, -2, 3]))
    found = fit_similarity(points, truth.apply(points))
    assert abs(found.scale - 2.5) < 1e-12
    np.testing.assert_allclose(found.rotation, truth.rotation, atol=1e-12)
    np.testing.assert_allclose(found.after(truth).apply(points), found.apply(truth.apply(points)), atol=1e-12)


def test_mirrored_points_are_not_answered_with_a_mirror() -> None:
    points = np.random.default_rng(4).normal(size=(20, 3))
    assert np.linalg.det(fit_similarity(points, points * [-1, 1, 1]).rotation) > 0.99


def test_scattered_points_lie_on_the_mesh_by_area() -> None:
    triangles = triangles_of(FACES)
    points = scatter(triangles, areas(SQUARE, triangles), 20_000, np.random.default_rng(0)).interpolate(SQUARE)
    assert (points[:, 2] == 0).all()
    assert abs((points[:, 1] > 1).mean() - 0.5) < 0.015
    low = points[points[:, 1] < 1]
    np.testing.assert_allclose(low.mean(axis=0), [1, 0.5, 0], atol=0.03)


def test_values_go_with_points() -> None:
    triangles = triangles_of(FACES)
    points = scatter(triangles, areas(SQUARE, triangles), 50, np.random.default_rng(0))
    np.testing.assert_allclose(points.interpolate(SQUARE[:, 0]), points.interpolate(SQUARE)[:, 0])


def test_neighbors_are_averaged() -> None:
    mean, has = neighbor_mean(np.array([[0.0], [2], [4]]), np.array([[0, 1], [0, 2]]))
    assert mean[0] == 3
    assert has.tolist() == [True, False, False]


def test_smoothstep_goes_either_way() -> None:
    np.testing.assert_allclose(smoothstep([-1, 0, 0.5, 1, 2], 0, 1), [0, 0, 0.5, 1, 1])
    np.testing.assert_allclose(smoothstep([0, 1], 1, 0), [1, 0])


@pytest.mark.slow
def test_nearest_points_are_those_of_a_dense_search() -> None:
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.linspace(-2, 2, 15), np.linspace(-2, 2, 15))
    vertices = np.stack([x, y, np.cos(x) * np.cos(y)], axis=-1).reshape(-1, 3)
    corner = np.arange(15 * 15).reshape(15, 15)
    quads = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    triangles = triangles_of(quads)
    points = np.column_stack([rng.uniform(-1.5, 1.5, (40, 2)), rng.uniform(-0.5, 1.5, 40)])
    found = nearest_on_surface(points, vertices, triangles)
    dense = scatter(triangles, areas(vertices, triangles), 200_000, rng).interpolate(vertices)
    truth = np.linalg.norm(dense[None] - points[:, None], axis=-1).min(axis=1)
    distance = np.linalg.norm(found.interpolate(vertices) - points, axis=1)
    assert (distance < truth + 0.01).all()
    np.testing.assert_allclose(found.weights.sum(axis=1), 1)
