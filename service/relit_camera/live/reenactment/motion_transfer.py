"""Motion transfer: the pose, expression and points that the driver's motion gives to the source image's head."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.rotations import Rotation
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment.control_points import (
    EARS_AND_JAW,
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
    unmoving = face.pose
    turned = rotate_about(NECK_PIVOT, unmoving, soft_limit_rotation(motion.rotation, MAX_ROTATION_DEG))
    body = unmoving.translation + motion.translation - turned.translation
    depth = unmoving.depth_of(NECK_PIVOT)
    scale = float(np.clip(depth / max(depth - body[2], 1.0), *SCALE_RANGE))
    shift = np.clip(body[:2], -MAX_SHIFT_CM, MAX_SHIFT_CM) * [1, -1] * unmoving.focal_px / depth
    return BodyMotion(turned, shift, scale, project(NECK_PIVOT[None], unmoving, face.size)[0])


def transfer_motion(face: SourceFace, points: ControlPoints, motion: FaceMotion) -> TransferredPose:
    """Move the head of a source image that shows the person whole, as the driver's head moved since neutral.

    The rotation and the expression (head-space displacements in cm of the same canonical face) are taken over as they
    are; see `split_body_motion` for the head's displacement.
    """
    body = split_body_motion(face, motion)
    landmarks = project(face.head_points + motion.expression, body.turned, face.size).astype(np.float64)
    shoulders = points.source[-len(SHOULDER_ANCHORS_CM) :]  # they stay
    head = rigid_head_anchors(body.turned, face.size)
    ears = np.s_[-len(EARS_AND_JAW) :]
    unmoving = points.source[: -len(SHOULDER_ANCHORS_CM)][ears]
    head[ears] = keep_beside_face(head[ears], landmarks, unmoving, face.landmarks.astype(np.float64))
    moved = np.vstack([landmarks[points.chosen], head, shoulders])
    return TransferredPose(moved, landmarks, body.turned, body.shift, body.scale, body.pivot)


def keep_beside_face(
    anchors: NDArray[np.float64],
    landmarks: NDArray[np.float64],
    anchors_before: NDArray[np.float64],
    landmarks_before: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Anchors of `EARS_AND_JAW` that a turned face would hide, moved to its outline: what is beside the face stays so.

    Else the skin between outline and ear of the source image would lie beside the far cheek, which it widens.

    Args:
        anchors: (count, 2) where they went.
        landmarks: (landmarks, 2) where the face went.
        anchors_before: as `anchors`, in the source image.
        landmarks_before: as `landmarks`, in the source image.
    """
    side = np.sign(EARS_AND_JAW[:, 0])
    beside = side * (anchors[:, 0] - _outline(landmarks, anchors[:, 1], side))
    beside_before = side * (anchors_before[:, 0] - _outline(landmarks_before, anchors_before[:, 1], side))
    return np.asarray(anchors + np.column_stack([side * np.maximum(beside_before - beside, 0), np.zeros(len(side))]))


def _outline(
    landmarks: NDArray[np.float64], rows: NDArray[np.float64], side: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Columns (count,) at which the hull of a face ends in some rows: at its left where `side` is −1, else right."""
    hull = cv2.convexHull(landmarks.astype(np.float32))[:, 0].astype(np.float64)
    top, bottom = int(hull[:, 1].argmin()), int(hull[:, 1].argmax())
    # OpenCV's hulls run clockwise as seen: from the top over the right side to the bottom.
    around = np.roll(hull, -top, axis=0)
    last = (bottom - top) % len(hull)
    right, left = around[: last + 1], np.vstack([around[last:], around[:1]])[::-1]
    ends = np.interp(rows, right[:, 1], right[:, 0]), np.interp(rows, left[:, 1], left[:, 0])
    return np.asarray(np.where(side > 0, *ends))


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
