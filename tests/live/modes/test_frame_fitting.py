"""Live frames of any size fitted to the output's."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.base.images.image_types import Frame
from relit_camera.live.modes.frame_fitting import fit_frame
from tests.small_camera import difference


def frame(index: int, image: np.ndarray) -> Frame:
    return Frame(image, index, 0.0, 0.0)


def test_fitted_covers_and_centres() -> None:
    wide = np.zeros((100, 400, 3), np.uint8)
    wide[:, 190:210] = 255
    cut = fit_frame(frame(3, wide), (200, 100))
    assert cut.size == (200, 100)
    assert cut.index == 3
    np.testing.assert_array_equal(cut.image, wide[:, 100:300])
    same = frame(0, wide)
    assert fit_frame(same, (400, 100)) is same
    small = fit_frame(frame(0, wide), (100, 50)).image
    expected = np.asarray(cv2.resize(wide[:, 100:300], (100, 50), interpolation=cv2.INTER_AREA), np.uint8)
    assert difference(small, expected) < 2
    stripes = np.zeros((90, 180, 3), np.uint8)
    stripes[:, ::3] = 255
    assert (fit_frame(frame(0, stripes), (60, 30)).image == 85).all()  # what is finer than its pixels is averaged
