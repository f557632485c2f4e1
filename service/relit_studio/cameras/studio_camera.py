"""The studio's camera: a pinhole on the Z axis that looks along -Z at an upright head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Points
from relit_studio.cameras.pinhole import Pinhole


@dataclass(frozen=True)
class Camera:
    """A picture centerd `middle_cm` above the head's origin.

    Attributes:
        height: pixels.
        width: pixels; as many as the height where None.
        distance_cm: from the head's origin, which lies between the ears; the nose is 12 cm before it.
        view_cm: what the height spans at the head's origin.
        middle_cm: height of the optical axis.
    """

    height: int
    width: int | None = None
    distance_cm: float = 74.0
    view_cm: float = 38.0
    middle_cm: float = 2.2

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width or self.height, self.height

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.height * self.distance_cm / self.view_cm

    @property
    def position_cm(self) -> NDArray[np.float64]:
        """Position (3,) of the camera in room axes."""
        return np.array([0.0, self.middle_cm, self.distance_cm])

    def project(self, points: NDArray) -> Points:
        """Pixels (count, 2) float32, centers at integers + ½, of room points (count, 3) in centimeters."""
        seen = Pinhole(*self.size, self.focal_px).project(np.asarray(points, np.float64) - self.position_cm)
        return seen[:, :2].astype(np.float32)
