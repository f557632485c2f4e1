"""Films whose light comes from too few directions are refused, with what to do."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.lamp.light_coverage import (
    count_distinct_directions,
    covered_solid_angle,
    require_light_coverage,
)
from relit_camera.light.directions import direction_from_degrees, fibonacci_directions


def spread(azimuth: float, elevation: float, count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(0)
    return direction_from_degrees(rng.uniform(-azimuth, azimuth, count), rng.uniform(-elevation, elevation, count))


def test_light_all_over_the_front_is_enough() -> None:
    require_light_coverage(spread(60, 45), 200)


@pytest.mark.parametrize(
    ("directions", "what", "cure"),
    [
        (spread(12, 12), "the light comes only from beside the camera", "do not use the phone's own lamp"),
        (spread(15, 15) @ np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]), "from one side", "move another around"),
        (np.zeros((0, 3)), "0 usable directions of light in 90 bright frames", "half a minute"),
        (spread(60, 45, 30), "usable directions of light in 90 bright frames, 40 are needed", "half a minute"),
        (direction_from_degrees(np.linspace(-45, 45, 90), 5.0), "the light covers", "from one ear to the other"),
    ],
)
def test_too_little_light_is_refused(directions: np.ndarray, what: str, cure: str) -> None:
    with pytest.raises(CaptureError) as refused:
        require_light_coverage(directions, 90)
    assert what in refused.value.what
    assert cure in refused.value.cure


def test_directions_within_a_degree_are_one() -> None:
    assert count_distinct_directions(direction_from_degrees(np.array([0, 0.5, 10, 10.2, 0.1]), 0.0)) == 2


def test_the_known_area_is_that_of_the_caps() -> None:
    cap = 2 * np.pi * (1 - np.cos(np.radians(12)))
    assert covered_solid_angle(np.array([[0.0, 0.0, 3.0]])) == pytest.approx(cap, rel=0.15)
    assert covered_solid_angle(fibonacci_directions(500)) == pytest.approx(4 * np.pi)
