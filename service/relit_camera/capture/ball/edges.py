"""Edges that stay in place while the light moves."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.sample import SceneSample

_BLUR_PX = 1.0
_AROUND_PX = 7
"""Side of the window whose brightest pixel a gradient is measured by."""
_BLACK = 0.003
"""Luminance below which differences are noise."""
_CONTRAST = 0.04
"""An edge with this share of the brightness a pixel counts half."""

Plane = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class EdgeMap:
    """Where a scene has edges: the mean over its pictures of the gradient's outer product with itself.

    So an edge counts where it is now brighter and now darker than what is beside it, as a ball's limb is when the
    light moves. Each gradient is taken in linear light, in which a blurred edge stays where it is, in shares of the
    brightness there, and counts between 0 and 1.

    Attributes:
        xx, xy, yy: float32 (height, width), the tensor's parts.
    """

    xx: Plane
    xy: Plane
    yy: Plane

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.xx.shape[1], self.xx.shape[0]

    def reduced(self, factor: float) -> EdgeMap:
        """The same for a picture of `factor` (at most 1) times as many pixels along each side."""
        size = (max(1, round(self.size[0] * factor)), max(1, round(self.size[1] * factor)))
        return EdgeMap(*(cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (self.xx, self.xy, self.yy)))

    def lines(self) -> tuple[Plane, Plane]:
        """Strength 0..1 (height, width), 0 but on the ridge of each edge; and the unit normal (height, width, 2)."""
        angle = 0.5 * np.arctan2(2 * self.xy, self.xx - self.yy)
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        strength = self.xx + self.yy
        rows, columns = np.indices(strength.shape, dtype=np.float32)
        sides = [
            cv2.remap(strength, columns + sign * normal[..., 0], rows + sign * normal[..., 1], cv2.INTER_LINEAR)
            for sign in (-1, 1)
        ]
        return np.where((strength >= sides[0]) & (strength >= sides[1]), strength, np.float32(0)), normal

    def along(self, x: NDArray, y: NDArray, angle: NDArray) -> Plane:
        """How clear an edge across the direction `angle` (radians, from x toward y) is at pixels x, y (all (h, w))."""
        parts = [
            cv2.remap(part, (x - 0.5).astype(np.float32), (y - 0.5).astype(np.float32), cv2.INTER_LINEAR)
            for part in (self.xx, self.xy, self.yy)
        ]
        cos, sin = np.cos(angle), np.sin(angle)
        return np.asarray(cos * cos * parts[0] + 2 * cos * sin * parts[1] + sin * sin * parts[2], np.float32)


def edge_map(sample: SceneSample) -> EdgeMap:
    """The edges that the pictures of a sample have in common."""
    xx, xy, yy = (np.zeros(sample.codes.shape[1:], np.float32) for _ in range(3))
    for index in range(len(sample.codes)):
        light = cv2.GaussianBlur(sample.luminance(index), (0, 0), _BLUR_PX)
        level = cv2.dilate(light, np.ones((_AROUND_PX, _AROUND_PX), np.uint8)) + np.float32(_BLACK)
        dx, dy = cv2.Scharr(light, cv2.CV_32F, 1, 0) / 32 / level, cv2.Scharr(light, cv2.CV_32F, 0, 1) / 32 / level
        clear = 1 / (dx * dx + dy * dy + np.float32(_CONTRAST**2))
        xx += dx * dx * clear
        xy += dx * dy * clear
        yy += dy * dy * clear
    count = np.float32(len(sample.codes))
    return EdgeMap(xx / count, xy / count, yy / count)
