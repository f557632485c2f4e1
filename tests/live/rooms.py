"""The small person before a camera, in a room whose light is known: the live picture is the own still, relit."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage
from relit_camera.base.rotations import Rotation
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.face.motion.neutral_face import NeutralFace
from relit_camera.light.directions import direction_from_degrees, texel_directions
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from tests.live.people import SCHEME, close_up, face_of

LARGER = 2
"""The live picture has twice the still's size."""


def soft_light(
    azimuth_deg: float, elevation_deg: float, colour: list[float], sharpness: float = 6.0, fill: float = 0.03
):
    """One wide soft light and a weak fill from everywhere: (32, 64, 3) radiance."""
    towards = texel_directions() @ direction_from_degrees(azimuth_deg, elevation_deg)
    return (np.exp(sharpness * (towards - 1))[..., None] * colour + fill).astype(np.float32)


WINDOW = soft_light(60, 25, [1.0, 0.8, 0.6])
EVENING = soft_light(-75, 10, [0.5, 0.7, 1.2])


@cache
def relighter() -> BasisRelighter:
    """Of the small person."""
    return BasisRelighter(close_up())


def still_under(light: LightMap, turn: Rotation | None = None) -> LinearImage:
    """The source image's linear picture in the room's light, the head turned, exposed so that little of it clips."""
    relit = relighter().relight(rotate_light_map(light, turn or Rotation.identity())[None])[0]
    return relit * exposure()


@cache
def exposure() -> np.float32:
    """One camera exposure for all rooms."""
    relit = relighter().relight(WINDOW[None])[0]
    return np.float32(0.7 / np.percentile(relit, 99))


def live_picture(light: LightMap, turn: Rotation | None = None) -> DisplayImage:
    """The camera's picture, uint8, of the person in the room."""
    picture = np.clip(still_under(light, turn), 0, None)
    large = cv2.resize(picture, None, fx=LARGER, fy=LARGER, interpolation=cv2.INTER_LINEAR)
    return uint8_from_linear(np.asarray(large, np.float32))


def live_frame(image: DisplayImage, time_s: float) -> Frame:
    return Frame(image, round(time_s * 30), time_s, time_s)


def before_the_camera(
    turn: Rotation | None = None, presence: float = 1.0, points: np.ndarray | None = None
) -> FaceMotion:
    """The motion of the person who looks as in the source image; `turn` is what the light sees of it."""
    face = face_of(close_up())
    points = face.head_points if points is None else points
    pose = HeadPose(face.pose.rotation, face.pose.translation, face.pose.focal_px * LARGER)
    zeros = np.zeros((SCHEME.count, 3))
    landmarks = (face.landmarks * LARGER).astype(np.float32)
    turn = turn or Rotation.identity()
    return FaceMotion(FaceStatus.FOUND, presence, turn, np.zeros(3), zeros, landmarks, pose, NeutralFace(points, pose))
