"""Interpolation over directions: exact at samples, a partition of unity inside, nothing outside."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import LightsError, NotFoundError
from relit_camera.capture.reflectance.delaunay_triangulation import spherical_barycentric
from relit_camera.capture.reflectance.method_registry import LinearMethod, method_names, open_method
from relit_camera.capture.reflectance.methods.barycentric_methods import PlanarBarycentric, SphericalBarycentric
from relit_camera.capture.reflectance.methods.linear_methods import Nearest
from relit_camera.light.directions import (
    direction_from_degrees,
    direction_from_spherical,
    spherical_from_direction,
    texel_directions,
)
from tests.synthetic import fibonacci_directions, sphere_samples

METHODS: list[LinearMethod] = [SphericalBarycentric(), PlanarBarycentric(), Nearest()]


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_a_captured_direction_returns_its_own_light(method: LinearMethod) -> None:
    directions = fibonacci_directions(90, lowest_z=0.1)
    weights = method.weights(directions, directions)
    np.testing.assert_allclose(weights, np.eye(len(directions)), atol=1e-5)


def test_weights_sum_to_one_over_a_full_sphere() -> None:
    weights = SphericalBarycentric().weights(fibonacci_directions(120), texel_directions().reshape(-1, 3))
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-5)
    assert weights.min() >= 0
    assert (weights > 1e-7).sum(axis=0).max() <= 3


def test_a_frontal_capture_says_nothing_of_the_back() -> None:
    directions = fibonacci_directions(200, lowest_z=0.2)
    back = direction_from_degrees([180, 150, -150], [0, 20, -20])
    front = direction_from_degrees([0, 20, -20], [0, 20, -20])
    weights = SphericalBarycentric().weights(directions, np.vstack([front, back]))
    np.testing.assert_allclose(weights.sum(axis=0), [1, 1, 1, 0, 0, 0], atol=1e-6)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_rounded_directions_at_the_edge_of_a_capture_are_covered(method: LinearMethod) -> None:
    """People give directions in tenths of a degree; half of those at the edge then lie a little outside."""
    directions = fibonacci_directions(400, lowest_z=0.1)
    azimuth, elevation = (np.round(np.degrees(angle), 1) for angle in spherical_from_direction(directions))
    weights = method.weights(directions, direction_from_degrees(azimuth, elevation))
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-5)
    np.testing.assert_array_equal(weights.argmax(axis=0), np.arange(len(directions)))


def test_planar_weights_reproduce_position_in_the_plane() -> None:
    directions = fibonacci_directions(90, lowest_z=0.1)
    plane = np.stack(spherical_from_direction(directions), axis=1)
    wanted = np.radians([[10, 5], [-33, 20], [41, -12]])
    weights = PlanarBarycentric().weights(directions, direction_from_spherical(wanted[:, 0], wanted[:, 1]))
    np.testing.assert_allclose(weights.T @ plane, wanted, atol=1e-6)


def test_areas_of_the_octant_at_its_middle_and_edge() -> None:
    octant = np.eye(3)[None]
    middle = np.ones((1, 3)) / np.sqrt(3)
    np.testing.assert_allclose(spherical_barycentric(middle, octant), [[1 / 3] * 3], atol=1e-12)
    edge = np.array([[1.0, 1.0, 0.0]]) / np.sqrt(2)
    np.testing.assert_allclose(spherical_barycentric(edge, octant), [[0.5, 0.5, 0]], atol=1e-12)


def test_spherical_is_nearer_to_the_truth_than_planar_and_nearest() -> None:
    """Thesis 5.2: areas on the sphere interpolate better than areas in the plane, near the poles above all."""
    samples = sphere_samples(220, 16)
    held = np.zeros(len(samples.directions), bool)
    held[::4] = True
    errors = {}
    for method in METHODS:
        weights = method.weights(samples.directions[~held], samples.directions[held])
        guess = np.tensordot(weights.T, samples.pictures[~held], axes=(1, 0))
        covered = weights.sum(axis=0) > 0.99
        errors[type(method).__name__] = np.mean((guess - samples.pictures[held])[covered] ** 2)
    assert errors["SphericalBarycentric"] < errors["PlanarBarycentric"] < errors["Nearest"]


@pytest.mark.parametrize(
    "directions", [np.eye(3), np.stack([np.cos(np.arange(8)), np.sin(np.arange(8)), np.zeros(8)], 1)]
)
def test_directions_without_extent_are_refused(directions: np.ndarray) -> None:
    with pytest.raises(LightsError, match="span no region"):
        SphericalBarycentric().weights(directions, np.eye(3))


def test_methods_are_found_by_name() -> None:
    thesis = {"planar", "barycentric", "visibility", "visibility-sharp", "adaptation", "thesis"}
    assert thesis | {"nearest", "ptm", "sh3", "rbf", "gp"} <= set(method_names())
    assert open_method("barycentric") == SphericalBarycentric()
    with pytest.raises(NotFoundError, match="there are: default"):
        open_method("magic")
