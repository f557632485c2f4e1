"""Ratio relighting: the live frame times relit(target) / relit(room) of the still warped onto it.

The person's own mouth, eyes and texture live on; only the light is exchanged.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import SubjectError
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import Frame, LinearImage, Mask
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.room_light_estimator import RoomLightEstimator
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.face_mesh import triangulate_face
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow
from relit_camera.live.reenactment.reenactor import ReenactorContext, WarpedLayer, WarpTask
from relit_camera.live.reenactment.source_image import SourceFace, feather_edges
from relit_camera.live.reenactment.warp import Warp, sample_bilinear

RATIO_RANGE = (0.02, 12.0)
RATIO_FLOOR = 0.03
"""Share of the room-lit face's mean that is added to both sides of the ratio: shadows stay bounded."""
MIN_CHANNEL_MEAN = 1e-3
"""Linear: the least mean of a channel under the room's light that counts; three sRGB codes."""
EDGE_MARGIN = 0.02
"""Share of the still's width at the matte's edge that is not trusted."""
RATIO_DOWNSAMPLING = 2
"""The ratio is warped and extended at this fraction of the frame's size: it is as soft as the still."""
EXTRAPOLATION_DOWNSAMPLING = 8
"""The extension beyond the still is computed at this fraction of that."""
STRANGER_SHAPE_CM, STRANGER_RESIDUAL = 0.14, 0.12
"""What a stranger reaches: a face of another shape (RMS of landmarks), that no light explains (relative deviation).

Measured: the same person .04 cm and .08 to .10 (a generated one .18 and .08), others .14 to .29 cm and .10 to .20.
Either alone can mislead (a beard, a cap), so their product decides.
"""
IDENTITY_CHECK_DELAY_S = 1.5
"""The face is judged after this long."""


class RatioReenactor:
    """See `Reenactor`; the live picture is used as it is, so there is no matte: alpha is 1."""

    def __init__(self, stage: ReenactorContext) -> None:
        self._face = stage.face
        self._relighter = stage.relighter
        self._points = control_points(stage.face, head_and_shoulder_anchors(stage.face.pose, stage.face.size))
        self._mesh = triangulate_face(stage.face)
        self._motion = DenseMotion(stage.options)
        self._room_light = RoomLightEstimator(stage.subject, stage.face)
        self._weight = ratio_confidence(feather_edges(stage.subject.matte))
        self._since: float | None = None

    def plan_warp(self, motion: FaceMotion, frame: Frame) -> WarpTask:
        """See `Reenactor.plan_warp`.

        Raises:
            SubjectError: the live face is not the subject's: no light explains it.
        """
        width, height = frame.size
        everywhere = np.ones((height, width), np.float32)
        if motion.pose is None:
            return lambda relit: WarpedLayer(linear_from_display(frame.image), everywhere, (0, 0))
        room = self._room_light.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
        self._check_person(room.residual, motion, frame.time_s)
        small = (0, 0, -(-width // RATIO_DOWNSAMPLING), -(-height // RATIO_DOWNSAMPLING))
        positions = self._warp(motion, frame.size).map(small)

        def warp(relit: LinearImage) -> WarpedLayer:
            # Here, not in `plan_warp`, though it needs no relit picture: so both halves of a frame take as long.
            ratio = self._ratio(relit, self._relighter.relight(room.in_head_frame) * room.gain)
            weighted = np.dstack([ratio * self._weight[..., None], self._weight]).astype(np.float32)
            everywhere_known = extrapolate_ratio(sample_bilinear(weighted, positions, cv2.BORDER_REPLICATE))
            large = cv2.resize(
                everywhere_known,
                (small[2] * RATIO_DOWNSAMPLING, small[3] * RATIO_DOWNSAMPLING),
                interpolation=cv2.INTER_LINEAR,
            )
            # Not `linear_from_display`: what it makes of the brightest codes, where skin is red first, is a guess that
            # a ratio would show as red blotches.
            picture = cv2.multiply(linear_from_uint8(frame.image), np.ascontiguousarray(large[:height, :width]))
            if motion.presence < 1:
                # Where nobody is tracked with confidence the picture eases back to the live one, as both are shown:
                # in linear light that guess would be in the mixture.
                presence = float(motion.presence)
                shown = display_from_linear(picture)
                picture = linear_from_display(cv2.addWeighted(shown, presence, frame.image, 1 - presence, 0))
            return WarpedLayer(np.asarray(picture, dtype=np.float32), everywhere, (0, 0))

        return warp

    def _ratio(self, relit: LinearImage, under_room: LinearImage) -> LinearImage:
        """How much brighter the still is relit than under the room's light."""
        # A room may have no light at all of one colour; then the live picture has none of it either.
        floor = RATIO_FLOOR * np.maximum(under_room[self._weight > 0.5].mean(axis=0), MIN_CHANNEL_MEAN)
        ratio = (relit + floor) / (np.maximum(under_room, 0) + floor)
        return np.asarray(np.clip(ratio, *RATIO_RANGE), dtype=np.float32)

    def _check_person(self, residual: float, motion: FaceMotion, time_s: float) -> None:
        self._since = time_s if self._since is None else min(self._since, time_s)
        if motion.neutral is None or motion.presence < 1 or time_s - self._since < IDENTITY_CHECK_DELAY_S:
            return
        shape = shape_distance_cm(motion.neutral.points, self._face)
        if (shape / STRANGER_SHAPE_CM) * (residual / STRANGER_RESIDUAL) > 1:
            raise SubjectError(
                "the live face is not the subject's: it has another shape "
                f"({10 * shape:.1f} mm) and looks so under no light (deviation {residual:.2f})",
                "choose your own subject, or mode reenact",
            )

    def _warp(self, motion: FaceMotion, size: tuple[int, int]) -> Warp:
        """The still as it lies on the live face, for a picture smaller by COARSE.

        One similarity for the head, a dense flow for the rest.
        """
        assert motion.pose is not None
        face, chosen = self._face, self._points.chosen
        landmarks = motion.landmarks.astype(np.float64)
        live = np.vstack([landmarks[chosen], head_and_shoulder_anchors(motion.pose, size)])
        source_from_live = fit_similarity(landmarks[list(face.scheme.rigid)], face.landmarks[list(face.scheme.rigid)])
        target = live @ source_from_live[:, :2].T + source_from_live[:, 2]
        moved = landmarks @ source_from_live[:, :2].T + source_from_live[:, 2]
        source_from_live = source_from_live @ np.diag([RATIO_DOWNSAMPLING, RATIO_DOWNSAMPLING, 1.0])
        # Lids and lips are the live picture's; the light on them is that of the skin round them.
        flow = face_and_head_flow(self._motion, self._mesh, self._points, target, moved, motion.pose, fine=False)
        return Warp(source_from_live, flow)


def shape_distance_cm(points: NDArray[np.float64], face: SourceFace) -> float:
    """RMS distance in cm, seen from the front, of head-space points (count, 3) from the still's.

    Size, place and what a wrong focal length does (near parts too large) are aside. Eyes and lips are left out: they
    move.
    """
    moving = {*face.scheme.eyes, *face.scheme.lips}
    firm = [index for index in range(face.scheme.count) if index not in moving]
    live, still = (p[firm] - p[firm].mean(axis=0) for p in (points, face.head_points))
    seen = live[:, :2]
    sizes = np.stack([seen.ravel(), (seen * live[:, 2:]).ravel()], axis=1)
    goal = still[:, :2].ravel()
    share = np.linalg.lstsq(sizes, goal)[0]
    return float(np.sqrt(((sizes @ share - goal) ** 2).sum() / len(firm)))


def ratio_confidence(matte: Mask) -> Mask:
    """How far the still's ratio counts: inside the matte, less toward its edge: its rim light is not the live one's."""
    reach = max(round(EDGE_MARGIN * matte.shape[1]), 1)
    inner = cv2.erode(matte, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)))
    return np.asarray(cv2.GaussianBlur(inner, (0, 0), reach / 2), dtype=np.float32)


def fit_similarity(points: NDArray[np.float64], onto: NDArray[np.floating]) -> NDArray[np.float64]:
    """The rotation, scale and shift (2, 3) that bring `points` (count, 2) nearest to `onto` in least squares."""
    centre, goal = points.mean(axis=0), onto.mean(axis=0)
    # As complex numbers a similarity is one factor, and least squares a quotient.
    p, q = (points - centre) @ [1, 1j], (onto - goal) @ [1, 1j]
    factor = np.vdot(p, q) / max(np.vdot(p, p).real, 1e-12)
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    return np.column_stack([turn, goal - turn @ centre])


def extrapolate_ratio(warped: NDArray[np.float32]) -> LinearImage:
    """A ratio (height, width, 3) for the whole frame, from one that is known only on the person.

    Args:
        warped: (height, width, 4): ratio times weight, and the weight.

    Beyond the person the ratio goes on smoothly: wide blurs of what is known, divided by the blurred weight.
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
