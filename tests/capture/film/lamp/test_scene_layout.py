"""Head, ball and lamp in centimetres, and the square about the head."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import InputError
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.lamp.head_crop import place_head_crop
from relit_camera.capture.film.lamp.scene_layout import estimate_scene_layout


def test_the_head_is_where_its_eyes_say() -> None:
    view = PinholeView(BallOutline(400, 100, 30), (640, 480), 600)
    place = estimate_scene_layout(view, (320 + 100, 240 - 50), 63, 100)
    assert place.pixels_per_cm == pytest.approx(10)
    np.testing.assert_allclose(place.head_cm, [10, 5, -60])
    # A ball whose size is not known is as far away as the head.
    assert place.near_light(view.outline).ball_cm[2] == pytest.approx(-60)


def test_a_ball_of_known_size_is_where_its_size_says() -> None:
    view = PinholeView(BallOutline(320, 240, 30), (640, 480), 600)
    place = estimate_scene_layout(view, (320, 240), 63, 100, ball_radius_cm=4)
    assert -place.near_light(view.outline).ball_cm[2] == pytest.approx(4 / np.sin(np.arctan(30 / 600)))


def test_a_lamp_nearer_than_the_ball_is_refused() -> None:
    view = PinholeView(BallOutline(600, 100, 30), (640, 480), 600)
    with pytest.raises(InputError, match="the light is said to be 20 cm from the head"):
        estimate_scene_layout(view, (320, 240), 63, 20).near_light(view.outline)


def test_the_square_stays_in_the_picture_and_invents_no_pixels() -> None:
    square = place_head_crop(FaceCircle(100, 120, 60), (240, 300), 512)
    assert (square.left, square.side, square.size) == (0, 240, 240)
    assert place_head_crop(FaceCircle(270, 300, 60), (540, 720), 128).size == 128


def test_the_square_shows_what_the_reference_would() -> None:
    x, y = np.meshgrid(np.arange(120) + 0.5, np.arange(160) + 0.5)
    square = place_head_crop(FaceCircle(60, 70, 20), (120, 160), 40)

    def seen(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.repeat((0.5 + 0.2 * np.sin(x / 9) + 0.2 * np.cos(y / 11))[..., None], 3, 2).astype(np.float32)

    place = (
        square.left + (np.arange(square.size) + 0.5) / square.scale,
        square.top + (np.arange(square.size) + 0.5) / square.scale,
    )
    expected = seen(*np.meshgrid(*place))
    np.testing.assert_allclose(square.cut(seen(x, y), RigidTransform()), expected, atol=0.005)
    # The frame is the reference, its content shifted back.
    np.testing.assert_allclose(
        square.cut(seen(x + 3, y - 2), RigidTransform(0, 3, -2))[4:-4, 4:-4], expected[4:-4, 4:-4], atol=0.005
    )
    assert square.place(*(each[7] for each in place)) == pytest.approx((7.5, 7.5))
