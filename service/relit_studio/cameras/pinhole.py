"""Pinhole projection, shared by all cameras of the studio.

Camera axes in centimeters: X right in the picture, Y up, Z toward the camera. The camera is at the origin, so visible
points have z < 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Pinhole:
    """A camera that looks along −Z, its axis through the picture's middle.

    Attributes:
        width, height: pixels.
        focal_px: focal length in pixels.
    """

    width: int
    height: int
    focal_px: float

    def project(self, points: NDArray) -> NDArray:
        """Pixels (count, 2), centers at integers + ½, and 1 / depth as third column, of points (count, 3)."""
        inverse = -1 / points[:, 2]
        x = self.width / 2 + self.focal_px * points[:, 0] * inverse
        y = self.height / 2 - self.focal_px * points[:, 1] * inverse
        return np.stack([x, y, inverse], axis=1)

    def rays(self, x: NDArray, y: NDArray) -> NDArray[np.float64]:
        """Unit vectors (..., 3) from the camera through pixel positions x and y (...)."""
        across = (np.asarray(x, np.float64) - self.width / 2) / self.focal_px
        up = (self.height / 2 - np.asarray(y, np.float64)) / self.focal_px
        ray = np.stack(np.broadcast_arrays(across, up, np.float64(-1)), axis=-1)
        return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))

    def pixel_grid(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """X and y (height, width) of the pixel centers."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        return x, y

    def scaled(self, factor: int) -> Pinhole:
        """The same view with `factor` times as many pixels along each side."""
        return Pinhole(self.width * factor, self.height * factor, self.focal_px * factor)
