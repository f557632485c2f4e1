from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.images.affine import opencv_affine
from relit_camera.face.landmarks.rotated_crop import Crop, bounding_box


def ramp(width: int = 200, height: int = 160) -> np.ndarray:
    """Red is x and green is y at the pixels' centres."""
    y, x = np.mgrid[:height, :width]
    return np.stack([x, y, 0 * x], axis=2).astype(np.uint8)


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.2])
def test_a_cut_shows_what_lies_at_its_positions(angle: float) -> None:
    crop = Crop(center=(90.0, 80.0), width=60.0, height=40.0, angle=angle)
    cut = crop.cut(ramp(), 64, 64)
    rows, columns = np.mgrid[4:60:8, 4:60:8]
    positions = np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=1).astype(np.float32)
    expected = crop.to_picture(positions, 64, 64) - 0.5  # the ramp counts pixel centres at integers
    seen = cut[rows.ravel(), columns.ravel(), :2]
    np.testing.assert_allclose(seen, expected, atol=0.6)


def test_the_middle_and_corners_of_an_upright_crop() -> None:
    crop = Crop(center=(50.0, 40.0), width=20.0, height=10.0)
    corners = np.array([[0, 0], [100, 100], [50, 50]], np.float32)
    np.testing.assert_allclose(crop.to_picture(corners, 100, 100), [[40, 35], [60, 45], [50, 40]])


def test_the_angle_is_clockwise_in_the_picture() -> None:
    crop = Crop(center=(0.0, 0.0), width=2.0, height=2.0, angle=np.pi / 2)
    np.testing.assert_allclose(crop.to_picture(np.array([[2, 1]], np.float32), 2, 2), [[0, 1]], atol=1e-6)


@pytest.mark.parametrize(("x", "y"), [(90.0, 80.0), (10.0, 150.0), (215.0, -20.0)])
def test_a_cut_is_opencvs_of_the_whole_picture(x: float, y: float) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (160, 200, 3), dtype=np.uint8)
    crop = Crop(center=(x, y), width=90.0, height=70.0, angle=0.5)
    affine = opencv_affine(crop.picture_from_pixels(64, 48))
    whole = cv2.warpAffine(picture, affine, (64, 48), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    difference = np.abs(crop.cut(picture, 64, 48).astype(int) - whole)
    assert whole.any()
    assert difference.max() <= 1
    assert (difference > 0).mean() < 0.002


def test_beyond_the_picture_is_black() -> None:
    assert (Crop(center=(-500.0, -500.0), width=20.0, height=20.0).cut(ramp(), 8, 8) == 0).all()


def test_bounds() -> None:
    assert bounding_box(np.array([[1, 5], [4, 2], [3, 9]], np.float32)) == (1, 2, 3, 7)
