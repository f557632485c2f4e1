"""Ratio relighting: the live frame times relit(target) / relit(room) of the still warped onto it.

The person's own mouth, eyes and texture live on; only the light is exchanged.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import SubjectError
from relit_camera.face.follow import FaceMotion
from relit_camera.reenact.control_points import control_points, head_anchors
from relit_camera.reenact.cutout import feathered
from relit_camera.reenact.dense_motion import DenseMotion
from relit_camera.reenact.face_mesh import face_mesh
from relit_camera.reenact.first_order import moved_flow
from relit_camera.reenact.reenactor import Move, Moved, Stage
from relit_camera.reenact.room_probe import RoomProbe
from relit_camera.reenact.source_face import SourceFace
from relit_camera.reenact.warp import Warp, sampled
from relit_camera.space.colour import linear_from_uint8
from relit_camera.space.display import display_from_linear, linear_from_display
from relit_camera.space.images import Frame, LinearImage, Mask

RATIO_RANGE = (0.02, 12.0)
FLOOR = 0.03
"""Share of the room-lit face's mean that is added to both sides of the ratio: shadows stay bounded."""
DARKEST = 1e-3
"""Linear: the least mean of a channel under the room's light that counts; three sRGB codes."""
EDGE = 0.02
"""Share of the still's width at the matte's edge that is not trusted."""
COARSE = 2
"""The ratio is warped and extended at this fraction of the frame's size: it is as soft as the still."""
EXTEND = 8
"""The extension beyond the still is computed at this fraction of that."""
SHAPE_CM, RESIDUAL = 0.14, 0.12
"""What a stranger reaches: a face of another shape (RMS of landmarks), that no light explains (relative deviation).

Measured: the same person .04 cm and .08 to .10 (a generated one .18 and .08), others .14 to .29 cm and .10 to .20.
Either alone can mislead (a beard, a cap), so their product decides.
"""
TRIAL_S = 1.5
"""The face is judged after this long."""


class RatioReenactor:
    """See `Reenactor`; the live picture is used as it is, so there is no matte: alpha is 1."""

    def __init__(self, stage: Stage) -> None:
        self._face = stage.face
        self._relighter = stage.relighter
        self._points = control_points(stage.face, head_anchors(stage.face.pose, stage.face.size))
        self._mesh = face_mesh(stage.face)
        self._motion = DenseMotion(stage.options)
        self._probe = RoomProbe(stage.subject, stage.face)
        self._weight = trusted(feathered(stage.subject.matte))
        self._since: float | None = None

    def follow(self, motion: FaceMotion, frame: Frame) -> Move:
        """See `Reenactor.follow`.

        Raises:
            SubjectError: the live face is not the subject's: no light explains it.
        """
        width, height = frame.size
        everywhere = np.ones((height, width), np.float32)
        if motion.pose is None:
            return lambda relit: Moved(linear_from_display(frame.image), everywhere, (0, 0))
        room = self._probe.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
        self._check_person(room.residual, motion, frame.time_s)
        small = (0, 0, -(-width // COARSE), -(-height // COARSE))
        positions = self._warp(motion, frame.size).map(small)

        def move(relit: LinearImage) -> Moved:
            # Here, not in `follow`, though it needs no relit picture: so both halves of a frame take as long.
            ratio = self._ratio(relit, self._relighter.relight(room.on_head) * room.gain)
            weighted = np.dstack([ratio * self._weight[..., None], self._weight]).astype(np.float32)
            everywhere_known = extended(sampled(weighted, positions, cv2.BORDER_REPLICATE))
            large = cv2.resize(everywhere_known, (small[2] * COARSE, small[3] * COARSE), interpolation=cv2.INTER_LINEAR)
            # Not `linear_from_display`: what it makes of the brightest codes, where skin is red first, is a guess that
            # a ratio would show as red blotches.
            picture = cv2.multiply(linear_from_uint8(frame.image), np.ascontiguousarray(large[:height, :width]))
            if motion.presence < 1:
                # Where nobody is tracked with confidence the picture eases back to the live one, as both are shown:
                # in linear light that guess would be in the mixture.
                presence = float(motion.presence)
                shown = display_from_linear(picture)
                picture = linear_from_display(cv2.addWeighted(shown, presence, frame.image, 1 - presence, 0))
            return Moved(np.asarray(picture, dtype=np.float32), everywhere, (0, 0))

        return move

    def _ratio(self, relit: LinearImage, under_room: LinearImage) -> LinearImage:
        """How much brighter the still is relit than under the room's light."""
        # A room may have no light at all of one colour; then the live picture has none of it either.
        floor = FLOOR * np.maximum(under_room[self._weight > 0.5].mean(axis=0), DARKEST)
        ratio = (relit + floor) / (np.maximum(under_room, 0) + floor)
        return np.asarray(np.clip(ratio, *RATIO_RANGE), dtype=np.float32)

    def _check_person(self, residual: float, motion: FaceMotion, time_s: float) -> None:
        self._since = time_s if self._since is None else min(self._since, time_s)
        if motion.neutral is None or motion.presence < 1 or time_s - self._since < TRIAL_S:
            return
        shape = shape_difference(motion.neutral.points, self._face)
        if (shape / SHAPE_CM) * (residual / RESIDUAL) > 1:
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
        live = np.vstack([landmarks[chosen], head_anchors(motion.pose, size)])
        still_from_live = similarity(landmarks[list(face.scheme.rigid)], face.landmarks[list(face.scheme.rigid)])
        target = live @ still_from_live[:, :2].T + still_from_live[:, 2]
        moved = landmarks @ still_from_live[:, :2].T + still_from_live[:, 2]
        still_from_live = still_from_live @ np.diag([COARSE, COARSE, 1.0])
        # Lids and lips are the live picture's; the light on them is that of the skin round them.
        flow = moved_flow(self._motion, self._mesh, self._points, target, moved, motion.pose, fine=False)
        return Warp(still_from_live, flow)


def shape_difference(points: NDArray[np.float64], face: SourceFace) -> float:
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


def trusted(matte: Mask) -> Mask:
    """How far the still's ratio counts: inside the matte, less toward its edge: its rim light is not the live one's."""
    reach = max(round(EDGE * matte.shape[1]), 1)
    inner = cv2.erode(matte, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)))
    return np.asarray(cv2.GaussianBlur(inner, (0, 0), reach / 2), dtype=np.float32)


def similarity(points: NDArray[np.float64], onto: NDArray[np.floating]) -> NDArray[np.float64]:
    """The rotation, scale and shift (2, 3) that bring `points` (count, 2) nearest to `onto` in least squares."""
    centre, goal = points.mean(axis=0), onto.mean(axis=0)
    # As complex numbers a similarity is one factor, and least squares a quotient.
    p, q = (points - centre) @ [1, 1j], (onto - goal) @ [1, 1j]
    factor = np.vdot(p, q) / max(np.vdot(p, p).real, 1e-12)
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    return np.column_stack([turn, goal - turn @ centre])


def extended(warped: NDArray[np.float32]) -> LinearImage:
    """A ratio (height, width, 3) for the whole frame, from one that is known only on the person.

    Args:
        warped: (height, width, 4): ratio times weight, and the weight.

    Beyond the person the ratio goes on smoothly: wide blurs of what is known, divided by the blurred weight.
    """
    height, width = warped.shape[:2]
    small = cv2.resize(warped, (max(width // EXTEND, 1), max(height // EXTEND, 1)), interpolation=cv2.INTER_AREA)
    spread = np.zeros_like(small)
    for sigma in (1.0, 3.0, 8.0, 20.0):
        # Narrow blurs win where they have weight: detail near the person, the mean far away.
        spread += cv2.GaussianBlur(small, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE) / np.float32(sigma**3)
    beyond = (spread[..., :3] + 1e-9) / (spread[..., 3:] + 1e-9)
    beyond = cv2.resize(beyond, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(warped[..., :3] + (1 - warped[..., 3:]) * beyond, dtype=np.float32)
