"""Resizing pictures: shrink by a factor, crop to fill a size, or fit whole into a size with bars around."""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Box, DisplayImage

Scalar = TypeVar("Scalar", bound=np.generic)


MIDDLE = (0.5, 0.5)


def box_to_fill(picture: tuple[int, int], size: tuple[int, int], middle: tuple[float, float] = MIDDLE) -> Box:
    """The largest box of a picture's size (width, height) that has the shape of another one.

    `middle` is where it lies, as shares of the picture's width and height, as far as the picture allows.
    """
    scale = max(size[0] / picture[0], size[1] / picture[1])
    columns, rows = (min(side, max(round(to / scale), 1)) for side, to in zip(picture, size, strict=True))
    left, top = (
        min(max(int(share * side - cut / 2), 0), side - cut)
        for share, side, cut in zip(middle, picture, (columns, rows), strict=True)
    )
    return left, top, left + columns, top + rows


def crop_to_fill(image: DisplayImage, size: tuple[int, int], middle: tuple[float, float] = MIDDLE) -> DisplayImage:
    """Scale the image to cover `size` (width, height), and crop it to that; see `box_to_fill`."""
    return resize_to_fill(image, size, cv2.INTER_CUBIC, middle)


def resize_to_fill(
    picture: NDArray[np.uint8],
    size: tuple[int, int],
    enlarging: int,
    middle: tuple[float, float] = MIDDLE,
) -> NDArray[np.uint8]:
    """As `crop_to_fill`, for any uint8 picture (height, width, ...); OpenCV interpolates by `enlarging` to enlarge."""
    left, top, right, bottom = box_to_fill((picture.shape[1], picture.shape[0]), size, middle)
    cut = np.ascontiguousarray(picture[top:bottom, left:right])
    shrinks = size[0] < right - left or size[1] < bottom - top
    filled: NDArray[np.uint8] = cv2.resize(cut, size, interpolation=cv2.INTER_AREA if shrinks else enlarging)
    return filled


def scaled_size(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Width and height `scale` times those of `size`, rounded, at least 1 px each."""
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))


def shrink(picture: NDArray[Scalar], scale: float) -> NDArray[Scalar]:
    """A picture (height, width[, channels]) at `scale` of its size, by the mean over areas; the same one from 1 up."""
    if scale >= 1:
        return picture
    size = scaled_size((picture.shape[1], picture.shape[0]), scale)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), picture.dtype)


def halve(picture: NDArray[Scalar]) -> NDArray[Scalar]:
    """A picture (height, width[, channels]) at half its size, rounded down: each pixel is the mean of four.

    OpenCV is several times as fast at this as at any other reduction.
    """
    size = (max(1, picture.shape[1] // 2), max(1, picture.shape[0] // 2))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), picture.dtype)


def letterbox(
    picture: DisplayImage, size: tuple[int, int], color: tuple[int, int, int], enlarging: int
) -> DisplayImage:
    """The picture fitted whole into the middle of `size` (width, height), bars of `color` beside or above and below.

    Shrunk by the mean over areas, enlarged with the interpolation `enlarging` of OpenCV's.
    """
    scale = min(size[0] / picture.shape[1], size[1] / picture.shape[0])
    width, height = scaled_size((picture.shape[1], picture.shape[0]), scale)
    canvas: DisplayImage = np.full((size[1], size[0], 3), color, np.uint8)
    x, y = (size[0] - width) // 2, (size[1] - height) // 2
    canvas[y : y + height, x : x + width] = cv2.resize(
        picture, (width, height), interpolation=cv2.INTER_AREA if scale < 1 else enlarging
    )
    return canvas
