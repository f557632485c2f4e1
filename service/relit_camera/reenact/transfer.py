"""Driving motion → the still's own head: which pose and expression, and where its points then lie (relative motion)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relit_camera.face.follow import FaceMotion
from relit_camera.face.pose import project
from relit_camera.face.state import HeadPose
from relit_camera.reenact.control_points import NECK_PIVOT, ControlPoints, still_anchors, turning_anchors
from relit_camera.reenact.source_face import SourceFace

MAX_SHIFT_CM = 12.0
"""A body moves aside by at most this much."""
FACE_MIDDLE = np.array([0.0, 0.0, 3.5])
"""Head axes, cm: it stays when a face turns in its place."""
MAX_TURN_DEG = 40.0
MAX_TURN_IN_FRAME_DEG = 22.0
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


@dataclass(frozen=True)
class BodyMotion:
    """How the whole person moves, with the head turned on its neck.

    Attributes:
        turned: pose of the turned head, before the person moves.
        shift, scale, pivot: as in `Target`.
    """

    turned: HeadPose
    shift: NDArray[np.float64]
    scale: float
    pivot: NDArray[np.float64]


def body_motion(face: SourceFace, motion: FaceMotion) -> BodyMotion:
    """Split the head's displacement: what turning on the neck explains bends the neck, the rest moves the body."""
    still = face.pose
    turned = turned_about(NECK_PIVOT, still, bent(motion.rotation, MAX_TURN_DEG))
    body = still.translation + motion.translation - turned.translation
    depth = -(still.rotation.apply(NECK_PIVOT) + still.translation)[2]
    scale = float(np.clip(depth / max(depth - body[2], 1.0), *SCALE_RANGE))
    shift = np.clip(body[:2], -MAX_SHIFT_CM, MAX_SHIFT_CM) * [1, -1] * still.focal_px / depth
    return BodyMotion(turned, shift, scale, project(NECK_PIVOT[None], still, face.size)[0])


def transfer(face: SourceFace, points: ControlPoints, motion: FaceMotion) -> Target:
    """Move the head of a still that shows the person whole, as the driver's head moved since neutral.

    The rotation and the expression (head-space displacements in cm of the same canonical face) are taken over as they
    are; see `body_motion` for the head's displacement.
    """
    body = body_motion(face, motion)
    landmarks = project(face.head_points + motion.expression, body.turned, face.size).astype(np.float64)
    anchors = [turning_anchors(body.turned, face.size), still_anchors(face.pose, face.size)]
    moved = np.vstack([landmarks[points.chosen], *anchors])
    return Target(moved, landmarks, body.turned, body.shift, body.scale, body.pivot)


def transfer_in_frame(face: SourceFace, points: ControlPoints, motion: FaceMotion) -> Target:
    """Move the face of a still that is cut off by its picture's border: it turns in its place, and less far.

    Nothing beyond the border was captured, so turns are bent softly to what fits inside.
    """
    turned = turned_about(FACE_MIDDLE, face.pose, bent(motion.rotation, MAX_TURN_IN_FRAME_DEG))
    landmarks = project(face.head_points + motion.expression, turned, face.size).astype(np.float64)
    return Target(landmarks[points.chosen], landmarks, turned, np.zeros(2), 1.0, np.zeros(2))


def bent(turn: Rotation, limit_deg: float) -> Rotation:
    """The turn, bent softly so that it never exceeds the limit: beyond it the still has nothing to show."""
    vector, limit = turn.as_rotvec(), np.radians(limit_deg)
    angle = float(np.linalg.norm(vector))
    return Rotation.from_rotvec(vector * (limit * np.tanh(angle / limit) / angle if angle > 0 else 1.0))


def turned_about(pivot: NDArray[np.float64], pose: HeadPose, turn: Rotation) -> HeadPose:
    """The pose after turning the head by `turn` (camera axes) about a point of it, (3,) cm in head axes."""
    rotation = turn * pose.rotation
    place = pose.rotation.apply(pivot) + pose.translation
    return HeadPose(rotation, place - rotation.apply(pivot), pose.focal_px)
