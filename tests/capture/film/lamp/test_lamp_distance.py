"""The lamp's distance over time, from two balls in some of the frames."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.film.lamp.lamp_distance import estimate_lamp_distances
from relit_camera.capture.film.lamp.light_from_highlight import LampTriangulation

TIMES = np.arange(0, 12, 0.1)
HEAD = np.array([1.0, -2.0, -60.0])
TRUE = 85 * (1 + 0.1 * np.sin(TIMES))


def triangulated(noise: float = 0.0, gap_deg: float = 0.1, across_cm: float = 24.0) -> dict[int, LampTriangulation]:
    nearness = 1 / TRUE + np.random.default_rng(0).normal(0, noise / 85, len(TIMES))
    return {
        index: LampTriangulation(HEAD + [0, 0, 1 / each], gap_deg, across_cm)
        for index, each in enumerate(nearness.tolist())
    }


def test_accurate_distances_are_kept() -> None:
    found = estimate_lamp_distances(TIMES, triangulated(), HEAD, 100.0)
    np.testing.assert_allclose(found.cm, TRUE, rtol=0.01)
    assert found.error.max() < 0.04


def test_noise_is_smoothed() -> None:
    found = estimate_lamp_distances(TIMES, triangulated(noise=0.04, gap_deg=0.3), HEAD, 100.0)
    raw = np.array([1 / np.linalg.norm(each.position_cm - HEAD) for each in triangulated(noise=0.04).values()])
    assert np.std(found.cm / TRUE) < 0.6 * np.std(raw * TRUE)
    assert np.median(np.abs(found.cm / TRUE - 1) / found.error) < 1.2


def test_distances_are_interpolated_over_time() -> None:
    some = {index: each for index, each in triangulated().items() if index % 4 == 0}
    found = estimate_lamp_distances(TIMES, some, HEAD, 100.0)
    np.testing.assert_allclose(found.cm, TRUE, rtol=0.02)


def test_without_measurements_the_distance_is_the_usual_one_and_uncertain() -> None:
    found = estimate_lamp_distances(TIMES, {}, HEAD, 90.0)
    np.testing.assert_allclose(found.cm, 90)
    assert found.error == pytest.approx(np.full(len(TIMES), 0.51), abs=0.01)


def test_a_short_baseline_is_less_accurate() -> None:
    near, far = (estimate_lamp_distances(TIMES, triangulated(across_cm=across), HEAD, 100.0) for across in (24.0, 3.0))
    assert (far.error > 2 * near.error).all()
