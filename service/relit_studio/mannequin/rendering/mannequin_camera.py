"""The studio's camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.face.head_pose import HeadPose
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.mannequin.shape.figure import PIVOT, Posture

DISTANCE_CM = 50.0
VIEW_CM = 36.5
"""Length that the picture's side spans at the head's distance."""
_HEAD_ABOVE_MIDDLE_CM = 1.4


@dataclass(frozen=True)
class Camera:
    """Square pinhole camera of `size` pixels in front of the mannequin."""

    size: int

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.size * DISTANCE_CM / VIEW_CM

    def project(self, points: NDArray) -> NDArray:
        """Pixels (count, 2), centers at integers + ½, and 1 / distance as third column, of room points (count, 3)."""
        return Pinhole(self.size, self.size, self.focal_px).project(points + np.array(_PLACE, points.dtype))

    def towards(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """Unit vectors (count, 3) from room points (count, 3) to the camera."""
        offset = -(points + np.array(_PLACE, np.float32))
        return np.asarray(offset / np.linalg.norm(offset, axis=1, keepdims=True), np.float32)

    def head_pose(self, posture: Posture) -> HeadPose:
        """The true pose of the canonical face."""
        rotation = posture.rotation
        translation = np.array(_PLACE) + PIVOT - rotation.apply(PIVOT)
        return HeadPose(rotation, translation, self.focal_px)


_PLACE = (0.0, _HEAD_ABOVE_MIDDLE_CM, -DISTANCE_CM)
"""Camera coordinates of the room's origin."""
