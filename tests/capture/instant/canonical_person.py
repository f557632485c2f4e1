"""A person whose face is the canonical one: landmarks and a matte as a camera sees them."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.base.images.image_types import Mask, Points
from relit_camera.base.rotations import Rotation
from relit_camera.capture.instant.head_shape import FOCAL_LENGTHS
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme

SIZE = 128
PIXELS_PER_CM = 3.0


def canonical_pose(size: int = SIZE, yaw_deg: float = 0.0, pixels_per_cm: float = PIXELS_PER_CM) -> HeadPose:
    """The face in the middle of a picture."""
    distance = FOCAL_LENGTHS * size / pixels_per_cm
    rotation = Rotation.from_rotvec([0, np.radians(yaw_deg), 0])
    return HeadPose(rotation, np.array([0.0, 0.0, -distance]), FOCAL_LENGTHS * size)


def canonical_landmarks(pose: HeadPose, size: int = SIZE) -> Points:
    """Its landmarks of `mesh478`."""
    return project(landmark_scheme("mesh478").canonical, pose, (size, size))


def person_matte(size: int = SIZE, pixels_per_cm: float = PIXELS_PER_CM) -> Mask:
    """A head as large as a head, a neck, and shoulders that the picture cuts off."""
    matte = np.zeros((size, size), np.float32)
    middle = size // 2

    def px(centimeters: float) -> int:
        return round(centimeters * pixels_per_cm)

    cv2.ellipse(matte, (middle, middle - px(2)), (px(8.2), px(11.5)), 0, 0, 360, 1.0, -1)
    cv2.rectangle(matte, (middle - px(5.5), middle), (middle + px(5.5), size - 1), 1.0, -1)
    cv2.ellipse(matte, (middle, size + px(4)), (px(20), px(9)), 0, 0, 360, 1.0, -1)
    return matte
