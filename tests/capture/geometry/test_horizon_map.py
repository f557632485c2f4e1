"""Horizons of a wall, a plain and a ridge: trigonometry."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.geometry.horizon_map import HorizonMap, compute_horizon_map, sector_weights
from relit_camera.light.directions import bearing_from_direction, direction_from_degrees, fibonacci_directions


def test_bearing_and_height_of_a_direction() -> None:
    bearing, height = bearing_from_direction([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 1], [0, -1, -1]])
    np.testing.assert_allclose(np.degrees(bearing), [0, 90, 0, 180, -90])
    np.testing.assert_allclose(np.degrees(height), [0, 0, 90, 45, -45])


def test_a_wall_at_the_right_hides_low_light_from_the_right() -> None:
    depth = np.zeros((40, 60), np.float32)
    depth[:, 40:] = 10
    horizon = compute_horizon_map(depth)
    height = np.degrees(horizon.heights[20].astype(float))
    # Ten pixels high; the wall's first pixel is ten away, then twenty.
    assert height[30, 0] == pytest.approx(45, abs=3)
    assert height[20, 0] == pytest.approx(26.6, abs=2)
    assert height[30, 16] == pytest.approx(0, abs=0.1)
    pixel = np.array([20 * 60 + 30])
    lights = direction_from_degrees([80, 30, -80, 0], [0, 0, 0, 80])
    np.testing.assert_array_equal(horizon.margins(lights, pixel)[0] > 0, [False, True, True, True])


def test_above_and_below_are_not_mixed_up() -> None:
    depth = np.zeros((60, 40), np.float32)
    depth[:20] = 10
    margins = compute_horizon_map(depth).margins(direction_from_degrees([0, 0], [70, -70]), np.array([28 * 40 + 20]))
    assert margins[0, 0] < 0 < margins[0, 1]


def test_nothing_hides_light_from_outside_of_the_person() -> None:
    depth = np.full((30, 30), np.nan, np.float32)
    depth[10:20, 10:20] = 0
    heights = compute_horizon_map(depth).heights.astype(float)
    assert np.degrees(heights[15, 19, 0]) < -80
    assert np.degrees(heights[15, 12, 0]) == pytest.approx(0, abs=0.1)


def test_between_sectors_heights_are_interpolated() -> None:
    weights = sector_weights(fibonacci_directions(50), 8)
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-6)
    heights = np.zeros((1, 1, 8), np.float16)
    heights[0, 0, 1] = 0.8
    quarter = np.array([[np.cos(a), np.sin(a), 0] for a in np.radians([45, 33.75, 22.5, 56.25])])
    margins = HorizonMap(heights).margins(quarter, np.array([0]))
    np.testing.assert_allclose(margins[0], [-0.8, -0.6, -0.4, -0.6], atol=2e-3)
