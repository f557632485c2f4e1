"""The trend of strengths over directions."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.film.olat.flash_strength import remove_half_direction_trend, set_inverse_square_trend
from relit_camera.light.directions import direction_from_degrees

RNG = np.random.default_rng(0)
TOWARD = direction_from_degrees(RNG.uniform(-70, 70, 200), RNG.uniform(-15, 65, 200))
DISTANCE_CM = 95 * np.exp(0.1 * TOWARD[:, 0] + RNG.normal(0, 0.05, 200))
SKIN = np.exp(0.15 * TOWARD[:, 1] - 0.05 * TOWARD[:, 0])


def median_one(values: np.ndarray) -> np.ndarray:
    return values / np.median(values)


def test_the_trend_is_that_of_measured_distances() -> None:
    true = DISTANCE_CM**-2.0
    found = set_inverse_square_trend(true * SKIN, DISTANCE_CM[:, None] * TOWARD)
    np.testing.assert_allclose(found, median_one(true), rtol=0.02)


def test_flashes_that_point_elsewhere_do_not_bias_the_trend() -> None:
    true = DISTANCE_CM**-2.0
    true[TOWARD[:, 1] > 0.8] *= 0.3
    found = set_inverse_square_trend(true * SKIN, DISTANCE_CM[:, None] * TOWARD)
    np.testing.assert_allclose(found, median_one(true), rtol=0.04)


def test_without_measured_distances_half_of_the_trend_is_removed() -> None:
    found = remove_half_direction_trend(SKIN**2, 100 * TOWARD)
    np.testing.assert_allclose(found, median_one(SKIN), rtol=1e-6)
