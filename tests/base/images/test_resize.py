"""Shrinking pictures, and fitting them whole into a size."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.images.resize import letterbox, scaled_size, shrink


def test_shrinking_takes_means_and_keeps_the_type() -> None:
    picture = np.arange(16, dtype=np.float32).reshape(4, 4)
    small = shrink(picture, 0.5)
    assert small.dtype == np.float32
    np.testing.assert_allclose(small, [[2.5, 4.5], [10.5, 12.5]])


def test_a_picture_that_is_small_enough_is_returned_itself() -> None:
    picture = np.zeros((4, 4), np.uint8)
    assert shrink(picture, 1.0) is picture
    assert shrink(picture, 3.0) is picture


def test_no_side_vanishes() -> None:
    assert scaled_size((1000, 3), 0.01) == (10, 1)


@pytest.mark.parametrize(
    ("size", "rows", "columns"), [((8, 8), slice(2, 6), slice(0, 8)), ((4, 2), slice(0, 2), slice(0, 4))]
)
def test_a_picture_is_fitted_whole_between_bars(size: tuple[int, int], rows: slice, columns: slice) -> None:
    fitted = letterbox(np.full((2, 4, 3), 200, np.uint8), size, (1, 2, 3), cv2.INTER_CUBIC)
    assert fitted.shape == (size[1], size[0], 3)
    inside = np.zeros(fitted.shape[:2], bool)
    inside[rows, columns] = True
    assert (fitted[inside] == 200).all()
    assert (fitted[~inside] == (1, 2, 3)).all()
