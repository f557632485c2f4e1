"""Motion transfer: the pose, expression and points that the driver's motion gives to the source image's head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.rotations import Rotation
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment.control_points import (
    NECK_PIVOT,
    SHOULDER_ANCHORS_CM,
    ControlPoints,
    rigid_head_anchors,
)
from relit_camera.live.reenactment.source_image import SourceFace

MAX_SHIFT_CM = 12.0
"""A body moves aside by at most this much."""
FACE_CENTER = np.array([0.0, 0.0, 3.5])
"""Head axes, cm: it stays when a face turns in its place."""
MAX_ROTATION_DEG = 40.0
MAX_ROTATION_IN_PLACE_DEG = 22.0
SCALE_RANGE = (0.85, 1.3)


@dataclass(frozen=True)
class TransferredPose:
    """Where the source image's points must go.

    Attributes:
        points: (control points, 2) float64 source pixels, the head turned on a neck that stays.
        landmarks: (count, 2) float64 source pixels: every landmark, likewise.
        pose: of that head.
        shift: (2,) float64 source pixels by which the whole person then moves.
        scale: by which the whole person grows about the neck.
        pivot: (2,) float64 source pixels: the neck.
    """

    points: NDArray[np.float64]
    landmarks: NDArray[np.float64]
    pose: HeadPose
    shift: NDArray[np.float64]
    scale: float
    pivot: NDArray[np.float64]


@dataclass(frozen=True)
class BodyMotion:
    """How the whole person moves, with the head turned on its neck.

    Attributes:
        turned: pose of the turned head, before the person moves.
        shift, scale, pivot: as in `TransferredPose`.
    """

    turned: HeadPose
    shift: NDArray[np.float64]
    scale: float
    pivot: NDArray[np.float64]


def split_body_motion(face: SourceFace, motion: FaceMotion) -> BodyMotion:
    """Split the head's displacement: what turning on the neck explains bends the neck, the rest moves the body."""
    still = face.pose
    turned = rotate_about(NECK_PIVOT, still, soft_limit_rotation(motion.rotation, MAX_ROTATION_DEG))
    body = still.translation + motion.translation - turned.translation
    depth = still.depth_of(NECK_PIVOT)
    scale = float(np.clip(depth / max(depth - body[2], 1.0), *SCALE_RANGE))
    shift = np.clip(body[:2], -MAX_SHIFT_CM, MAX_SHIFT_CM) * [1, -1] * still.focal_px / depth
    return BodyMotion(turned, shift, scale, project(NECK_PIVOT[None], still, face.size)[0])


def transfer_motion(face: SourceFace, points: ControlPoints, motion: FaceMotion) -> TransferredPose:
    """Move the head of a source image that shows the person whole, as the driver's head moved since neutral.

    The rotation and the expression (head-space displacements in cm of the same canonical face) are taken over as they
    are; see `split_body_motion` for the head's displacement.
    """
    body = split_body_motion(face, motion)
    landmarks = project(face.head_points + motion.expression, body.turned, face.size).astype(np.float64)
    shoulders = points.source[-len(SHOULDER_ANCHORS_CM) :]  # they stay
    moved = np.vstack([landmarks[points.chosen], rigid_head_anchors(body.turned, face.size), shoulders])
    return TransferredPose(moved, landmarks, body.turned, body.shift, body.scale, body.pivot)


def transfer_motion_in_place(face: SourceFace, points: ControlPoints, motion: FaceMotion) -> TransferredPose:
    """Move the face of a source image that is cut off by its picture's border: it turns in its place, and less far.

    Nothing beyond the border was captured, so turns are bent softly to what fits inside.
    """
    turned = rotate_about(FACE_CENTER, face.pose, soft_limit_rotation(motion.rotation, MAX_ROTATION_IN_PLACE_DEG))
    landmarks = project(face.head_points + motion.expression, turned, face.size).astype(np.float64)
    return TransferredPose(landmarks[points.chosen], landmarks, turned, np.zeros(2), 1.0, np.zeros(2))


def soft_limit_rotation(turn: Rotation, limit_deg: float) -> Rotation:
    """The turn, bent softly so that it never exceeds the limit: beyond it the source image shows nothing."""
    vector, limit = turn.as_rotvec(), np.radians(limit_deg)
    angle = float(np.linalg.norm(vector))
    return Rotation.from_rotvec(vector * (limit * np.tanh(angle / limit) / angle if angle > 0 else 1.0))


def rotate_about(pivot: NDArray[np.float64], pose: HeadPose, turn: Rotation) -> HeadPose:
    """The pose after turning the head by `turn` (camera axes) about a point of it, (3,) cm in head axes."""
    rotation = turn * pose.rotation
    place = pose.rotation.apply(pivot) + pose.translation
    return HeadPose(rotation, place - rotation.apply(pivot), pose.focal_px)
