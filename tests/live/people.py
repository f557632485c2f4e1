"""A small person whose face is known exactly, and live faces that move as given."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Mask
from relit_camera.base.images.tone_mapping import linear_from_display
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose, guess_focal, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.face.motion.neutral_face import NeutralFace
from relit_camera.live.compositing.alpha_compositing import split_alpha
from relit_camera.live.reenactment.reenactor import Reenactor, ReenactorContext, WarpedLayer
from relit_camera.live.reenactment.source_image import SourceFace, find_source_face
from relit_camera.live.render_quality import FULL_QUALITY
from relit_camera.subject.subject import Subject
from tests.generated_subject import generated_subject

SCHEME = landmark_scheme("mesh478")
LIVE_SIZE = (320, 240)
LIVE_NEUTRAL = HeadPose(rotation_from_angles(4), np.array([3.0, -1.0, -60.0]), guess_focal(LIVE_SIZE))
NEUTRAL = NeutralFace(SCHEME.canonical.copy(), LIVE_NEUTRAL)


class Blind:
    """A tracker that finds no face: so the landmarks stored with a subject count."""

    name, scheme = "blind", "mesh478"

    def track(self, frame: Frame) -> FaceState:
        return LOST

    def reset(self) -> None:
        """Nothing is kept between frames."""


@cache
def close_up() -> Subject:
    """A face that fills its picture, 96 x 128, cut off by the border; not taken over black."""
    subject = generated_subject(96, 128)
    return dataclasses.replace(subject, metadata=subject.metadata.model_copy(update={"over_black": False}))


@cache
def person() -> Subject:
    """The same, with background beside and above the head."""
    subject = close_up()
    height, width = subject.matte.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    distance = np.hypot((x - width / 2) / (0.42 * width), (y - height / 2) / (0.46 * height))
    body = np.clip(1 - np.abs(x - width / 2) / (0.4 * width), 0, 0.2) * 5 * (y > height / 2)
    matte = np.maximum(np.clip((1 - distance) * 12, 0, 1), body)
    return dataclasses.replace(subject, matte=matte.astype(np.float32))


def face_of(subject: Subject) -> SourceFace:
    """Its face, as stored with it."""
    return find_source_face(subject, Blind())


def context_of(subject: Subject, size: tuple[int, int], argument: str = "") -> ReenactorContext:
    """What a reenactor gets for pictures of `size`."""
    return ReenactorContext(subject, face_of(subject), size, SessionOptions(), argument)


def lids_lowered(face: SourceFace, share: float = 1.0) -> NDArray[np.float64]:
    """The expression, head-space cm, that brings each upper lid down by a share of the way to the lower one."""
    expression = np.zeros((SCHEME.count, 3))
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        inner = eye.lids.index(eye.inner)
        upper, lower = list(eye.lids[1:inner]), list(eye.lids[:inner:-1])
        expression[upper, :2] = share * (face.head_points[lower] - face.head_points[upper])[:, :2]
    return expression


def motion(
    turn: Rotation | None = None,
    shift: ArrayLike = (0, 0, 0),
    expression: NDArray[np.float64] | None = None,
    presence: float = 1.0,
    status: FaceStatus = FaceStatus.FOUND,
) -> FaceMotion:
    """A live face that has moved from `LIVE_NEUTRAL` by a rotation, centimetres, and head-space centimetres a point."""
    turn = turn or Rotation.identity()
    expression = np.zeros((SCHEME.count, 3)) if expression is None else expression
    shift = np.asarray(shift, dtype=np.float64)
    now = HeadPose(turn * LIVE_NEUTRAL.rotation, LIVE_NEUTRAL.translation + shift, LIVE_NEUTRAL.focal_px)
    landmarks = project(NEUTRAL.points + expression, now, LIVE_SIZE)
    return FaceMotion(status, presence, turn, shift, expression, landmarks, now, NEUTRAL)


NOBODY = FaceMotion(
    FaceStatus.LOST, 0.0, Rotation.identity(), np.zeros(3), np.zeros((SCHEME.count, 3)), np.zeros((0, 2), np.float32),
    None, None,
)  # fmt: skip


def moved_by(reenactor: Reenactor, relit: LinearImage, motion: FaceMotion, frame: Frame) -> WarpedLayer:
    """A frame as mode portrait does it: plan the warp, then warp the relit picture."""
    return reenactor.plan_warp(motion, frame, FULL_QUALITY)(relit)


def premultiplied(layer: WarpedLayer) -> tuple[LinearImage, Mask]:
    """The layer's picture in linear light, premultiplied, and its alpha in 0..1."""
    colors, alpha = split_alpha(layer.image)
    share = np.divide(alpha, 255, dtype=np.float32)
    return np.multiply(linear_from_display(colors), share[..., None], dtype=np.float32), share


def live_frame(image: DisplayImage | None = None, index: int = 0) -> Frame:
    """A frame of the live size: grey noise unless given."""
    if image is None:
        image = np.random.default_rng(index).integers(60, 180, (LIVE_SIZE[1], LIVE_SIZE[0], 3)).astype(np.uint8)
    return Frame(image, index, index / 30, index / 30)
