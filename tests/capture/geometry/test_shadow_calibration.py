"""Horizons learn from shadows: what was seen wins, what was not is left."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.geometry.horizon_map import HorizonMap, calibrate_horizon_map
from relit_camera.light.directions import bearing_from_direction
from tests.capture.geometry.shapes import front_lights

SIZE = (12, 14)
PIXELS = np.arange(SIZE[0] * SIZE[1])


def lit_above(height: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Shares (lights, height, width), 1 or 0, where light above `height` (sectors,) radians arrives."""
    margins = HorizonMap(np.broadcast_to(height, (*SIZE, len(height))).astype(np.float16)).margins(directions, PIXELS)
    return (margins > 0).T.reshape(-1, *SIZE).astype(np.float16)


def test_a_horizon_that_agrees_stays() -> None:
    rng = np.random.default_rng(2)
    heights = rng.uniform(0.1, 0.9, 16)
    directions = front_lights(60, 0.1)
    known = HorizonMap(np.broadcast_to(heights, (*SIZE, 16)).astype(np.float16))
    np.testing.assert_array_equal(
        calibrate_horizon_map(known, lit_above(heights, directions), directions).heights, known.heights
    )


def test_shadows_move_a_wrong_horizon() -> None:
    directions = front_lights(120, 0.05)
    truth = 0.6 + 0.3 * np.cos(2 * np.pi * np.arange(32) / 32)
    seen = lit_above(truth, directions)
    shown, kept_back = directions[::2], directions[1::2]
    flat = HorizonMap(np.full((*SIZE, 32), 0.2, np.float16))
    wrong_before = ((seen[1::2].reshape(-1, len(PIXELS)) > 0.5) != (flat.margins(kept_back, PIXELS) > 0).T).mean()
    found = calibrate_horizon_map(flat, seen[::2], shown)
    wrong = ((seen[1::2].reshape(-1, len(PIXELS)) > 0.5) != (found.margins(kept_back, PIXELS) > 0).T).mean()
    assert wrong_before > 0.2
    assert wrong < 0.25 * wrong_before
    agreed = (seen[::2].reshape(-1, len(PIXELS)) > 0.5) == (found.margins(shown, PIXELS) > 0).T
    assert agreed.mean() > 0.97


def test_half_shadows_and_the_unknown_say_nothing() -> None:
    directions = front_lights(40, 0.1)
    flat = HorizonMap(np.full((*SIZE, 16), 0.7, np.float16))
    lit = np.full((len(directions), *SIZE), 0.5, np.float16)
    lit[::2] = np.nan
    np.testing.assert_array_equal(calibrate_horizon_map(flat, lit, directions).heights, flat.heights)


def test_one_light_has_its_say_in_its_own_bearing_alone() -> None:
    directions = np.array([[0.95, 0.0, 0.312]])
    flat = HorizonMap(np.full((*SIZE, 32), 1.0, np.float16))
    found = calibrate_horizon_map(flat, np.ones((1, *SIZE), np.float16), directions).heights.astype(float)
    assert (found[..., 0] < bearing_from_direction(directions)[1]).all()
    np.testing.assert_array_equal(found[..., 16], 1.0)
