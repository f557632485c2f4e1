"""The conserving interpolation: exact on constants and on energy, also at the poles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles
from relit_camera.light.light_map_interpolation import pad_poles, padded_positions, splat


def fibonacci(count: int) -> np.ndarray:
    """Unit vectors (count, 3), even over the sphere."""
    y = 1 - 2 * (np.arange(count) + 0.5) / count
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - y * y)
    return np.stack([radius * np.sin(angle), y, radius * np.cos(angle)], axis=1)


@given(st.floats(-180, 180), st.floats(-90, 90))
@settings(max_examples=60)
def test_a_splatted_light_keeps_its_energy(azimuth: float, elevation: float) -> None:
    radiance = splat(direction_from_degrees(azimuth, elevation)[None], np.array([2.5]))
    assert (radiance >= 0).all()
    assert (radiance * texel_solid_angles()).sum() == pytest.approx(2.5, rel=1e-6)


@given(st.floats(-180, 180), st.floats(-90, 90))
@settings(max_examples=60)
def test_a_splatted_light_is_where_it_was(azimuth: float, elevation: float) -> None:
    direction = direction_from_degrees(azimuth, elevation)
    energy = splat(direction[None], np.array([1.0])) * texel_solid_angles()
    centroid = np.einsum("ij,ijk->k", energy, texel_directions())
    angle = np.degrees(np.arccos(np.clip(centroid @ direction / np.linalg.norm(centroid), -1, 1)))
    # A point within a texel of the pole is drawn toward it; everywhere else bilinear weights keep the mean.
    assert angle < (1.5 if abs(elevation) > 80 else 0.3)


def test_even_light_makes_an_even_map() -> None:
    count = 100_000
    radiance = splat(fibonacci(count), np.full(count, 4 * np.pi / count))
    np.testing.assert_allclose(radiance, 1, atol=2e-3)


def test_a_constant_map_stays_constant_in_extension() -> None:
    np.testing.assert_allclose(pad_poles(np.full((32, 64, 3), 3.0, np.float32)), 3, rtol=1e-6)


def test_positions_stay_inside_the_extended_map() -> None:
    odd = np.array([[0, 1, 0], [0, -1, 0], [0, 0, -1], [-1e-9, 0, -1], [1, 0, 0], [0, 1 + 1e-7, 0]])
    row, column = padded_positions(*np.concatenate([odd, fibonacci(1000)]).T)
    assert row.min() >= 0
    assert row.max() <= 33
    assert column.min() >= 0.5
    assert column.max() <= 64.5
