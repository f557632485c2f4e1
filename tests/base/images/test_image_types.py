"""Checks of image types."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import ImageError
from relit_camera.base.images.image_types import Frame, check_image


def test_a_frame_knows_its_size() -> None:
    assert Frame(np.zeros((4, 6, 3), np.uint8), 0, 0.0, 0.0).size == (6, 4)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 6), np.uint8),
        np.zeros((4, 6, 4), np.uint8),
        np.zeros((4, 6, 3), np.float32),
        np.zeros((0, 6, 3), np.uint8),
    ],
)
def test_wrong_images_are_refused_with_their_shape(image: np.ndarray) -> None:
    with pytest.raises(ImageError, match="picture has shape"):
        check_image(image, np.uint8, "picture")


def test_channels_can_be_asked_for() -> None:
    check_image(np.zeros((4, 6, 4), np.float32), np.float32, "matte", channels=4)
