"""Affine maps between the project's pixel centres and OpenCV's."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.base.images.affine import opencv_affine


def test_a_picture_enlarged_about_its_corner_stays_at_that_corner() -> None:
    picture = np.arange(12, dtype=np.float32).reshape(3, 4)
    double = np.array([[2.0, 0, 0], [0, 2.0, 0]])
    enlarged = cv2.warpAffine(picture, opencv_affine(double), (8, 6), flags=cv2.INTER_NEAREST)
    np.testing.assert_array_equal(enlarged, picture.repeat(2, axis=0).repeat(2, axis=1))


def test_the_map_given_is_left_as_it_is() -> None:
    double = np.array([[2.0, 0, 0], [0, 2.0, 0]])
    opencv_affine(double)
    np.testing.assert_array_equal(double, [[2, 0, 0], [0, 2, 0]])
