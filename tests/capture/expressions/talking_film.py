"""A tracked film of a generated face that opens its mouth, shuts its eyes, looks aside and turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.capture.expressions.film_tracking import TrackedFace, TrackedFilm
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.motion.neutral_face import NeutralFace

SCHEME = landmark_scheme("mesh478")
SIZE = (640, 480)
LOWER = sorted({*SCHEME.lower_lip_inner[1:-1], *SCHEME.lower_lip_outer[1:-1]})


def moved_points(open_cm: float = 0.0, shut: float = 0.0, gaze_cm: float = 0.0) -> NDArray[np.float64]:
    """The canonical face's points with an opened mouth, shut eyes, or irises moved aside."""
    points = SCHEME.canonical.copy()
    points[LOWER, 1] -= open_cm
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        inner = eye.lids.index(eye.inner)
        for upper, lower in zip(eye.lids[1:inner], eye.lids[:inner:-1], strict=True):
            points[upper] += shut * (points[lower] - points[upper])
        points[list(eye.iris), 0] += gaze_cm
    return points


def tracked(
    index: int, points: NDArray[np.float64], yaw: float = 0.0, pitch: float = 0.0, sharpness: float = 1.0
) -> TrackedFace:
    """A frame in which the face has these points and turn."""
    pose = HeadPose(rotation_from_angles(yaw, pitch), np.array([0.0, 0.0, -50.0]), 640.0)
    return TrackedFace(index, index / 30, project(points, pose, SIZE), points, pose, 0.3, 0.0, sharpness)


def film(*faces: TrackedFace) -> TrackedFilm:
    """A film of some faces, the canonical one neutral."""
    neutral = NeutralFace(SCHEME.canonical.copy(), tracked(0, SCHEME.canonical).pose)
    return TrackedFilm("talk.mp4", SIZE, SCHEME, faces, neutral)
