"""Resizing pictures to the size and shape of the output."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage


def crop_to_fill(image: DisplayImage, size: tuple[int, int]) -> DisplayImage:
    """Scale the image to cover `size` (width, height), and crop it to that about its middle."""
    return resize_to_fill(image, size, cv2.INTER_CUBIC)


def resize_to_fill(picture: NDArray[np.uint8], size: tuple[int, int], enlarging: int) -> NDArray[np.uint8]:
    """As `crop_to_fill`, for any uint8 picture (height, width, ...); OpenCV interpolates by `enlarging` to enlarge."""
    height, width = picture.shape[:2]
    scale = max(size[0] / width, size[1] / height)
    columns, rows = min(width, round(size[0] / scale)), min(height, round(size[1] / scale))
    left, top = (width - columns) // 2, (height - rows) // 2
    cut = np.ascontiguousarray(picture[top : top + rows, left : left + columns])
    filled: NDArray[np.uint8] = cv2.resize(cut, size, interpolation=cv2.INTER_AREA if scale < 1 else enlarging)
    return filled
