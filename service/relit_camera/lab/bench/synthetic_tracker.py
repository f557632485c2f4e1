"""A tracker that needs no picture: it gives a mean face that turns and nods."""

from __future__ import annotations

import numpy as np

from relit_camera.base.images.image_types import Frame
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose, guess_focal, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme


class SyntheticTracker:
    """Tracker for tests without a face: gives a mean face that turns and nods, with its landmarks."""

    name = "nodding"
    scheme = "mesh478"

    def track(self, frame: Frame) -> FaceState:
        """A face 60 cm before the camera, its pose by the frame's time."""
        scheme, phase = landmark_scheme(self.scheme), 2 * np.pi * frame.time_s / 3
        rotation = rotation_from_angles(20 * np.sin(phase), 6 * np.sin(2 * phase), 4 * np.cos(phase))
        pose = HeadPose(rotation, np.array([0.0, 0.0, -60.0]), guess_focal(frame.size))
        landmarks = project(scheme.canonical.copy(), pose, frame.size)
        eyes, mouth = scheme.eyes_opening(landmarks), scheme.mouth_opening(landmarks)
        return FaceState(FaceStatus.FOUND, 1.0, self.scheme, landmarks, pose, eyes, mouth)

    def reset(self) -> None:
        """Do nothing: the tracker has no state."""
