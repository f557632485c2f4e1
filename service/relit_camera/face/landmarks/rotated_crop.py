"""Rotated crops: rectangles sampled from a picture, for networks that need the face upright and of fixed size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.affine import opencv_affine
from relit_camera.base.images.image_types import DisplayImage, Points


@dataclass(frozen=True)
class Crop:
    """A rectangle in a picture, which may be rotated.

    Attributes:
        center: (x, y) pixels, pixel centres at integers + ½.
        width, height: its sides in pixels of the picture.
        angle: clockwise in the picture, radians: the direction of its own x axis.
    """

    center: tuple[float, float]
    width: float
    height: float
    angle: float = 0.0

    def picture_from_pixels(self, columns: int, rows: int) -> NDArray[np.float64]:
        """(2, 3) affine map from positions in a `columns` x `rows` cut of this crop to positions in the picture."""
        (x, y), cos, sin = self.center, math.cos(self.angle), math.sin(self.angle)
        half_width, half_height = self.width / 2, self.height / 2
        scale_x, scale_y = self.width / columns, self.height / rows
        return np.array(
            [
                [cos * scale_x, -sin * scale_y, x - cos * half_width + sin * half_height],
                [sin * scale_x, cos * scale_y, y - sin * half_width - cos * half_height],
            ]
        )

    def cut(self, image: DisplayImage, columns: int, rows: int) -> DisplayImage:
        """Sample the crop to (rows, columns, 3), bilinear; black beyond the picture."""
        affine = opencv_affine(self.picture_from_pixels(columns, rows))
        left, top, right, bottom = self._bounds(image.shape[1], image.shape[0])
        if right <= left or bottom <= top:
            return np.zeros((rows, columns, 3), np.uint8)
        affine[:, 2] -= left, top
        # With a fourth channel OpenCV samples in less than half of the time, which is more than adding it takes.
        region = cv2.cvtColor(image[top:bottom, left:right], cv2.COLOR_RGB2RGBA)
        cut = cv2.warpAffine(region, affine, (columns, rows), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        return np.asarray(cv2.cvtColor(cut, cv2.COLOR_RGBA2RGB), dtype=np.uint8)

    def _bounds(self, width: int, height: int) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of all pixels that sampling reads, in a picture of `width` x `height`."""
        (x, y), cos, sin = self.center, abs(math.cos(self.angle)), abs(math.sin(self.angle))
        half_x, half_y = (cos * self.width + sin * self.height) / 2 + 2, (sin * self.width + cos * self.height) / 2 + 2
        left, top = max(math.floor(x - half_x), 0), max(math.floor(y - half_y), 0)
        return left, top, min(math.ceil(x + half_x), width), min(math.ceil(y + half_y), height)

    def to_picture(self, points: NDArray[np.float32], columns: int, rows: int) -> Points:
        """Positions (count, 2) in the picture of positions in a `columns` x `rows` cut of this crop."""
        affine = self.picture_from_pixels(columns, rows).astype(np.float32)
        return np.asarray(points @ affine[:, :2].T + affine[:, 2], dtype=np.float32)


def bounding_box(points: Points) -> tuple[float, float, float, float]:
    """The bounding box x, y, width, height of points (count, 2)."""
    axes = np.ascontiguousarray(points.T)  # NumPy's minimum over columns of two takes five times as long
    (x, y), (right, bottom) = axes.min(axis=1).tolist(), axes.max(axis=1).tolist()
    return x, y, right - x, bottom - y
