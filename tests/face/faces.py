"""Synthetic face states, made from a pose and a head shape."""

from __future__ import annotations

import numpy as np

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.landmarks.rotated_crop import Crop, bounding_box

SIZE = (640, 480)
RATE = 30.0
SCHEME = landmark_scheme("openseeface66")


def open_mouth(scheme: LandmarkScheme, gap_cm: float) -> np.ndarray:
    """The canonical head with the lower lip `gap_cm` lower."""
    points = scheme.canonical.copy()
    points[[*scheme.lower_lip_inner[1:-1], *scheme.lower_lip_outer[1:-1]], 1] -= gap_cm
    return points


def shut_eyes(scheme: LandmarkScheme) -> np.ndarray:
    """The canonical head with both upper lids on the lower ones."""
    points = scheme.canonical.copy()
    for eye in (scheme.right_eye, scheme.left_eye):
        points[list(eye.gap[0])] = points[list(eye.gap[1])]
    return points


def face(
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
    at: tuple[float, float, float] = (0.0, 0.0, -50.0),
    points: np.ndarray | None = None,
    status: FaceStatus = FaceStatus.FOUND,
    noise_px: float = 0.0,
    seed: int = 0,
) -> FaceState:
    """A state as an ideal tracker would measure it; `noise_px` shakes the landmarks."""
    pose = HeadPose(rotation_from_angles(yaw, pitch, roll), np.array(at), 640.0)
    landmarks = project(SCHEME.canonical if points is None else points, pose, SIZE)
    landmarks += np.random.default_rng(seed).normal(0, noise_px, landmarks.shape).astype(np.float32)
    return FaceState(
        status=status,
        confidence=0.9,
        scheme=SCHEME.name,
        landmarks=landmarks,
        pose=pose,
        eyes=SCHEME.eyes_opening(landmarks),
        mouth=SCHEME.mouth_opening(landmarks),
    )


class BoxCrops:
    """The crops of a stand-in for a landmark network: upright boxes."""

    scheme = SCHEME
    threshold = 0.5

    def crop_from_detection(self, detection: Detection) -> Crop:
        x, y, width, height = detection.box
        return Crop((x + width / 2, y + height / 2), width, height)

    def crop_from_points(self, points: np.ndarray) -> Crop:
        x, y, width, height = bounding_box(points)
        return Crop((x + width / 2, y + height / 2), width, height)
