"""The lamp's distance over time, from what two balls tell of it here and there."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.film.ball.light_direction import LightPosition
from relit_camera.capture.film.lamp.lamp_distance import estimate_lamp_distances

TIMES = np.arange(0, 12, 0.1)
HEAD = np.array([1.0, -2.0, -60.0])
TRUE = 85 * (1 + 0.1 * np.sin(TIMES))


def told(noise: float = 0.0, gap_deg: float = 0.1, across_cm: float = 24.0) -> dict[int, LightPosition]:
    nearness = 1 / TRUE + np.random.default_rng(0).normal(0, noise / 85, len(TIMES))
    return {
        index: LightPosition(HEAD + [0, 0, 1 / each], gap_deg, across_cm)
        for index, each in enumerate(nearness.tolist())
    }


def test_what_is_told_surely_is_believed() -> None:
    found = estimate_lamp_distances(TIMES, told(), HEAD, 100.0)
    np.testing.assert_allclose(found.cm, TRUE, rtol=0.01)
    assert found.error.max() < 0.04


def test_noise_is_evened_out() -> None:
    found = estimate_lamp_distances(TIMES, told(noise=0.04, gap_deg=0.3), HEAD, 100.0)
    raw = np.array([1 / np.linalg.norm(each.position_cm - HEAD) for each in told(noise=0.04).values()])
    assert np.std(found.cm / TRUE) < 0.6 * np.std(raw * TRUE)
    assert np.median(np.abs(found.cm / TRUE - 1) / found.error) < 1.2


def test_between_what_is_told_neighbours_count() -> None:
    some = {index: each for index, each in told().items() if index % 4 == 0}
    found = estimate_lamp_distances(TIMES, some, HEAD, 100.0)
    np.testing.assert_allclose(found.cm, TRUE, rtol=0.02)


def test_with_nothing_told_it_is_as_said_and_uncertain() -> None:
    found = estimate_lamp_distances(TIMES, {}, HEAD, 90.0)
    np.testing.assert_allclose(found.cm, 90)
    assert found.error == pytest.approx(np.full(len(TIMES), 0.51), abs=0.01)


def test_rays_that_hardly_part_tell_little() -> None:
    near, far = (estimate_lamp_distances(TIMES, told(across_cm=across), HEAD, 100.0) for across in (24.0, 3.0))
    assert (far.error > 2 * near.error).all()
