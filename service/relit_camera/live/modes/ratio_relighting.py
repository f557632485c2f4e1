"""Ratio relighting: the live frame times relit(scene) / relit(room) of the subject, warped onto the live face.

The person's own mouth, eyes and texture stay in the picture; only the light is exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Mask, Points
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.room_light_estimator import RoomLightEstimate
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.face_mesh import triangulate_face
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow
from relit_camera.live.reenactment.source_image import SourceFace, feather_edges
from relit_camera.live.reenactment.warp import Warp, sample_bilinear
from relit_camera.subject.relighting.relighter import Relighter
from relit_camera.subject.subject import Subject

RATIO_RANGE = (0.02, 12.0)
RATIO_FLOOR = 0.03
"""Share of the room-lit face's mean that is added to both sides of the ratio: shadows stay bounded."""
MIN_CHANNEL_MEAN = 1e-3
"""Linear: the least mean of a channel under the room's light that counts; three sRGB codes."""
EDGE_MARGIN = 0.02
"""Share of the source image's width at the matte's edge that is not trusted."""
RATIO_DOWNSAMPLING = 2
"""The ratio is warped and extrapolated at this fraction of the frame's size: it is as soft as the source image."""
EXTRAPOLATION_DOWNSAMPLING = 8
"""The extrapolation beyond the person is computed at this fraction of that."""


class RoomLight(Protocol):
    """What estimates the room's light; see `RoomLightEstimator`."""

    def update(self, image: DisplayImage, landmarks: Points, rotation: Rotation, time_s: float) -> RoomLightEstimate:
        """See `RoomLightEstimator.update`."""
        ...


@dataclass(frozen=True)
class RatioPlan:
    """What is known of one live frame before the subject is relit for it.

    Attributes:
        frame: the live frame.
        presence: how far it is relit, 0..1: 0 shows it as it is.
        room: the room's light in it.
        positions: (rows, columns, 2) float32 where each pixel of the downsampled frame lies in the source image.
    """

    frame: Frame
    presence: float
    room: RoomLightEstimate
    positions: NDArray[np.float32]


class RatioRelighting:
    """Exchanges the light on the live face of one subject. `plan` is for one thread; `apply` may run in another."""

    def __init__(
        self, subject: Subject, face: SourceFace, relighter: Relighter, room_light: RoomLight, motion: DenseMotion
    ) -> None:
        """Prepare for one subject.

        Args:
            subject: the person.
            face: the face in the source image.
            relighter: of that subject.
            room_light: estimates the room's light from the live face.
            motion: makes the flow between source image and live face.
        """
        self._face = face
        self._relighter = relighter
        self._room_light = room_light
        self._motion = motion
        self._points = control_points(face, head_and_shoulder_anchors(face.pose, face.size))
        self._mesh = triangulate_face(face)
        self._weight = ratio_confidence(feather_edges(subject.matte))

    def plan(self, motion: FaceMotion, pose: HeadPose, frame: Frame) -> RatioPlan:
        """Estimate the room's light, and where the source image lies on the live face.

        Args:
            motion: of the face in `frame`.
            pose: of the head in `frame`.
            frame: the live frame, of the output's size.
        """
        room = self._room_light.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
        columns, rows = _downsampled_size(frame.size)
        positions = self._warp(motion, pose, frame.size).map((0, 0, columns, rows))
        return RatioPlan(frame, float(motion.presence), room, positions)

    def apply(self, plan: RatioPlan, relit: LinearImage) -> LinearImage:
        """The planned frame in the light of `relit` (the subject's size): float32 linear, the frame's size."""
        image, presence = plan.frame.image, plan.presence
        width, height = plan.frame.size
        columns, rows = _downsampled_size(plan.frame.size)
        under_room = self._relighter.relight(plan.room.in_head_frame[None])[0]
        ratio = self._ratio(relit, under_room * plan.room.gain)
        weighted = np.dstack([ratio * self._weight[..., None], self._weight]).astype(np.float32)
        everywhere = extrapolate_ratio(sample_bilinear(weighted, plan.positions, cv2.BORDER_REPLICATE))
        large = cv2.resize(
            everywhere, (columns * RATIO_DOWNSAMPLING, rows * RATIO_DOWNSAMPLING), interpolation=cv2.INTER_LINEAR
        )
        # Not `linear_from_display`: what it makes of the brightest codes, where skin is red first, is a guess that
        # a ratio would show as red blotches.
        picture = cv2.multiply(linear_from_uint8(image), np.ascontiguousarray(large[:height, :width]))
        if presence < 1:
            # Where nobody is tracked with confidence the picture eases back to the live one, as both are shown:
            # in linear light that guess would be in the mixture.
            shown = display_from_linear(picture)
            picture = linear_from_display(cv2.addWeighted(shown, presence, image, 1 - presence, 0))
        return np.asarray(picture, dtype=np.float32)

    def _ratio(self, relit: LinearImage, under_room: LinearImage) -> LinearImage:
        """How much brighter the source image is relit than under the room's light."""
        # A room may have no light at all of one colour; then the live picture has none of it either.
        floor = RATIO_FLOOR * np.maximum(under_room[self._weight > 0.5].mean(axis=0), MIN_CHANNEL_MEAN)
        ratio = (relit + floor) / (np.maximum(under_room, 0) + floor)
        return np.asarray(np.clip(ratio, *RATIO_RANGE), dtype=np.float32)

    def _warp(self, motion: FaceMotion, pose: HeadPose, size: tuple[int, int]) -> Warp:
        """The source image as it lies on the live face of a frame of `size`, for the downsampled frame.

        One similarity for the head, a dense flow for the rest.
        """
        face, chosen = self._face, self._points.chosen
        landmarks = motion.landmarks.astype(np.float64)
        live = np.vstack([landmarks[chosen], head_and_shoulder_anchors(pose, size)])
        source_from_live = fit_similarity(landmarks[list(face.scheme.rigid)], face.landmarks[list(face.scheme.rigid)])
        target = live @ source_from_live[:, :2].T + source_from_live[:, 2]
        moved = landmarks @ source_from_live[:, :2].T + source_from_live[:, 2]
        source_from_live = source_from_live @ np.diag([RATIO_DOWNSAMPLING, RATIO_DOWNSAMPLING, 1.0])
        # Lids and lips are the live picture's; the light on them is that of the skin round them.
        flow = face_and_head_flow(self._motion, self._mesh, self._points, target, moved, pose, fine=False)
        return Warp(source_from_live, flow)


def _downsampled_size(size: tuple[int, int]) -> tuple[int, int]:
    """Columns and rows of the ratio for a frame of `size` (width, height)."""
    return -(-size[0] // RATIO_DOWNSAMPLING), -(-size[1] // RATIO_DOWNSAMPLING)


def ratio_confidence(matte: Mask) -> Mask:
    """How far the ratio counts, 0..1: in the matte, less toward its edge, whose rim light is not the live picture's."""
    reach = max(round(EDGE_MARGIN * matte.shape[1]), 1)
    inner = cv2.erode(matte, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)))
    return np.asarray(cv2.GaussianBlur(inner, (0, 0), reach / 2), dtype=np.float32)


def fit_similarity(points: NDArray[np.float64], onto: NDArray[np.floating]) -> NDArray[np.float64]:
    """The rotation, scale and shift (2, 3) that bring `points` (count, 2) nearest to `onto` in least squares."""
    center, goal = points.mean(axis=0), onto.mean(axis=0)
    # As complex numbers a similarity is one factor, and least squares a quotient.
    p, q = (points - center) @ [1, 1j], (onto - goal) @ [1, 1j]
    factor = np.vdot(p, q) / max(np.vdot(p, p).real, 1e-12)
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    return np.column_stack([turn, goal - turn @ center])


def extrapolate_ratio(warped: NDArray[np.float32]) -> LinearImage:
    """Extrapolate a ratio that is known only on the person to the whole frame: (height, width, 3).

    Beyond the person it goes on smoothly: wide blurs of what is known, divided by the blurred weight.

    Args:
        warped: (height, width, 4): ratio times weight, and the weight.
    """
    height, width = warped.shape[:2]
    small = cv2.resize(
        warped,
        (max(width // EXTRAPOLATION_DOWNSAMPLING, 1), max(height // EXTRAPOLATION_DOWNSAMPLING, 1)),
        interpolation=cv2.INTER_AREA,
    )
    spread = np.zeros_like(small)
    for sigma in (1.0, 3.0, 8.0, 20.0):
        # Narrow blurs win where they have weight: detail near the person, the mean far away.
        spread += cv2.GaussianBlur(small, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE) / np.float32(sigma**3)
    beyond = (spread[..., :3] + 1e-9) / (spread[..., 3:] + 1e-9)
    beyond = cv2.resize(beyond, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(warped[..., :3] + (1 - warped[..., 3:]) * beyond, dtype=np.float32)
