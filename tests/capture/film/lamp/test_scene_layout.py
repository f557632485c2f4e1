"""Head and balls in centimeters."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView
from relit_camera.capture.film.lamp.capture_layout import estimate_capture_layout


def test_the_distance_of_the_eyes_gives_the_depth_of_the_head() -> None:
    view = PinholeView(BallOutline(400, 100, 30), (640, 480), 600)
    layout = estimate_capture_layout([view], (320 + 100, 240 - 50), 63)
    assert layout.pixels_per_cm == pytest.approx(10)
    np.testing.assert_allclose(layout.head_cm, [10, 5, -60])
    # A ball whose size is not known is as far away as the head.
    assert (layout.ball_radius_cm * view.center)[2] == pytest.approx(-60)


def test_a_known_size_gives_the_depth_of_the_ball() -> None:
    view = PinholeView(BallOutline(320, 240, 30), (640, 480), 600)
    layout = estimate_capture_layout([view], (320, 240), 63, ball_radius_cm=4)
    assert -(layout.ball_radius_cm * view.center)[2] == pytest.approx(4 / np.sin(np.arctan(30 / 600)))


def test_two_balls_of_one_size_are_on_average_as_far_away_as_the_head() -> None:
    views = [PinholeView(BallOutline(x, 240, radius), (640, 480), 600) for x, radius in ((200, 30), (440, 20))]
    layout = estimate_capture_layout(views, (320, 240), 63)
    assert np.mean([layout.ball_radius_cm * view.center[2] for view in views]) == pytest.approx(-60)
