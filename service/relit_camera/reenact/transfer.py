"""Driving motion → the still's own head: which pose and expression, and where its points then lie (relative motion)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.face.follow import FaceMotion
from relit_camera.face.pose import project
from relit_camera.face.state import HeadPose
from relit_camera.reenact.control_points import NECK_PIVOT, ControlPoints, skull_ring, still_anchors
from relit_camera.reenact.source_face import SourceFace

MAX_SHIFT_CM = 12.0
"""A body moves aside by at most this much."""
SCALE_RANGE = (0.85, 1.3)


@dataclass(frozen=True)
class Target:
    """Where the still's points must go.

    Attributes:
        points: (control points, 2) float64 still pixels, the head turned on a neck that stays.
        landmarks: (count, 2) float64 still pixels: every landmark, likewise.
        pose: of that head.
        shift: (2,) float64 still pixels by which the whole person then moves.
        scale: by which the whole person grows about the neck.
        pivot: (2,) float64 still pixels: the neck.
    """

    points: NDArray[np.float64]
    landmarks: NDArray[np.float64]
    pose: HeadPose
    shift: NDArray[np.float64]
    scale: float
    pivot: NDArray[np.float64]


def transfer(face: SourceFace, points: ControlPoints, motion: FaceMotion) -> Target:
    """Move the still's head as the driver's moved since neutral.

    The rotation and the expression (head-space displacements in cm of the same canonical face) are taken over as they
    are. The head's displacement is split: what turning on the neck explains bends the neck, the rest moves the body.
    """
    still = face.pose
    rotation = motion.rotation * still.rotation
    pivot_camera = still.rotation.apply(NECK_PIVOT) + still.translation
    turned = HeadPose(rotation, pivot_camera - rotation.apply(NECK_PIVOT), still.focal_px)
    landmarks = project(face.head_points + motion.expression, turned, face.size)
    moved = np.vstack([landmarks[points.chosen], skull_ring(turned, face.size), still_anchors(still, face.size)])

    body = still.translation + motion.translation - turned.translation
    depth = -pivot_camera[2]
    scale = float(np.clip(depth / max(depth - body[2], 1.0), *SCALE_RANGE))
    shift = np.clip(body[:2], -MAX_SHIFT_CM, MAX_SHIFT_CM) * [1, -1] * still.focal_px / depth
    return Target(moved, landmarks, turned, shift, scale, project(NECK_PIVOT[None], still, face.size)[0])
