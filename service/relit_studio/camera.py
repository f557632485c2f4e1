"""The studio's camera: a pinhole on the Z axis that looks along -Z at an upright head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.space.images import Points


@dataclass(frozen=True)
class Camera:
    """A square picture of `size` pixels, centred `middle_cm` above the head's origin.

    Attributes:
        size: pixels a side.
        distance_cm: from the head's origin, which lies between the ears; the nose is 12 cm before it.
        view_cm: what a side spans at the head's origin.
        middle_cm: height of the optical axis.
    """

    size: int
    distance_cm: float = 74.0
    view_cm: float = 38.0
    middle_cm: float = 2.2

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.size * self.distance_cm / self.view_cm

    @property
    def position_cm(self) -> NDArray[np.float64]:
        """Where the camera is, (3,) in room axes."""
        return np.array([0.0, self.middle_cm, self.distance_cm])

    def project(self, points: NDArray) -> Points:
        """Pixels (count, 2) float32, centres at integers + ½, of room points (count, 3) in centimetres."""
        x, y, z = (np.asarray(points, np.float64) - self.position_cm).T
        scale = self.focal_px / -z
        return np.stack([self.size / 2 + x * scale, self.size / 2 - y * scale], axis=1).astype(np.float32)
