"""Directions against their definition, and solid angles against the sphere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relit_camera.light.directions import (
    direction_from_degrees,
    direction_from_spherical,
    fibonacci_directions,
    map_position_from_direction,
    spherical_from_direction,
    texel_directions,
    texel_solid_angles,
)

azimuths = st.floats(-180, 180, exclude_min=True)
elevations = st.floats(-90, 90)
sizes = st.tuples(st.integers(1, 60), st.integers(1, 120))


@pytest.mark.parametrize(
    ("degrees", "vector"),
    [((0, 0), (0, 0, 1)), ((90, 0), (1, 0, 0)), ((-90, 0), (-1, 0, 0)), ((180, 0), (0, 0, -1)), ((30, 90), (0, 1, 0)),
     ((0, -90), (0, -1, 0)), ((0, 45), (0, 2**-0.5, 2**-0.5))],
)  # fmt: skip
def test_named_directions(degrees: tuple[float, float], vector: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(direction_from_degrees(*degrees), vector, atol=1e-15)


@given(azimuths, elevations)
def test_vectors_have_unit_length(azimuth: float, elevation: float) -> None:
    assert np.linalg.norm(direction_from_degrees(azimuth, elevation)) == pytest.approx(1, abs=1e-14)


@given(azimuths, st.floats(-89.9, 89.9), st.floats(1e-3, 1e3))
def test_round_trip_whatever_the_length(azimuth: float, elevation: float, length: float) -> None:
    back = spherical_from_direction(length * direction_from_degrees(azimuth, elevation))
    np.testing.assert_allclose(np.degrees(back), (azimuth, elevation), atol=1e-9)


@given(elevations)
def test_angle_to_the_horizon_is_the_elevation(elevation: float) -> None:
    azimuth = np.linspace(-np.pi, np.pi, 7)
    np.testing.assert_allclose(
        direction_from_spherical(azimuth, np.radians(elevation))[:, 1], np.sin(np.radians(elevation)), atol=1e-15
    )


@given(sizes)
def test_solid_angles_cover_the_sphere(size: tuple[int, int]) -> None:
    angles = texel_solid_angles(*size)
    assert angles.shape == size
    assert angles.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    assert (angles > 0).all()


def test_solid_angle_of_a_polar_cap() -> None:
    # A cap of half-angle a covers 2π(1 − cos a).
    assert texel_solid_angles()[:4].sum() == pytest.approx(2 * np.pi * (1 - np.cos(4 * np.pi / 32)), rel=1e-12)


def test_solid_angles_integrate_a_cosine_to_pi() -> None:
    cosine = np.maximum(0, texel_directions(256, 512)[..., 2])
    assert (cosine * texel_solid_angles(256, 512)).sum() == pytest.approx(np.pi, rel=1e-4)


def test_fibonacci_directions_are_even_and_go_down() -> None:
    directions = fibonacci_directions(500)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-12)
    assert (np.diff(directions[:, 1]) < 0).all()
    np.testing.assert_allclose(directions.mean(axis=0), 0, atol=2e-3)
    np.testing.assert_allclose(directions.T @ directions / 500, np.eye(3) / 3, atol=2e-3)
    nearest = np.sort(directions @ directions.T, axis=1)[:, -2]
    assert np.degrees(np.arccos(nearest)).min() > 0.8 * np.degrees(np.sqrt(4 * np.pi / 500))


def test_first_texel_is_up_and_behind_on_the_left() -> None:
    x, y, z = texel_directions()[0, 0]
    assert y > 0.99
    assert x < 0
    assert z < 0


def test_the_map_s_middle_is_toward_the_camera_and_its_right_is_x() -> None:
    directions = texel_directions()
    assert directions[15:17, 31:33].mean(axis=(0, 1)) == pytest.approx((0, 0, 1), abs=0.01)
    assert directions[15:17, 47:49].mean(axis=(0, 1)) == pytest.approx((1, 0, 0), abs=0.01)


@given(sizes)
def test_positions_of_texel_centres_are_their_indices(size: tuple[int, int]) -> None:
    row, column = map_position_from_direction(texel_directions(*size), *size)
    rows, columns = np.indices(size)
    np.testing.assert_allclose(row, rows, atol=1e-6)
    np.testing.assert_allclose(column, columns, atol=1e-6)


@given(azimuths, elevations)
def test_positions_stay_on_the_map(azimuth: float, elevation: float) -> None:
    row, column = map_position_from_direction(direction_from_degrees(azimuth, elevation))
    assert -0.5 <= row <= 31.5
    assert -0.5 <= column < 63.5


def test_tables_cannot_be_spoilt() -> None:
    with pytest.raises(ValueError, match="read-only"):
        texel_directions()[0, 0, 0] = 1
    with pytest.raises(ValueError, match="read-only"):
        texel_solid_angles()[0, 0] = 1
