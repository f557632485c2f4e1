"""The square about the head."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.olat.head_crop import place_head_crop


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
    np.testing.assert_allclose(square.crop(seen(x, y), RigidTransform()), expected, atol=0.005)
    # The frame is the reference, its content shifted back.
    np.testing.assert_allclose(
        square.crop(seen(x + 3, y - 2), RigidTransform(0, 3, -2))[4:-4, 4:-4], expected[4:-4, 4:-4], atol=0.005
    )
    assert square.to_crop(*(each[7] for each in place)) == pytest.approx((7.5, 7.5))
