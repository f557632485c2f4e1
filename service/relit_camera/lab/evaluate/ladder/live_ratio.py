"""The live picture in another light, by the program's own mode live and its own estimate of the room's light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relit_camera.app.wiring import make_follower
from relit_camera.base.config.settings import TrackerSettings
from relit_camera.base.errors import SubjectError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.face_state import Tracker
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.frame_relighting import FacePlan, FramePlan, FrameRelighting
from relit_camera.live.modes.ratio_relighting import FaceLight, RatioRelighting, as_large_as_needed
from relit_camera.live.modes.room_light_estimator import RoomLightEstimator
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.source_image import find_source_face
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject

FRAME_INTERVAL_S = 0.25
"""Time from one frame to the next: the room's light is fitted in each."""


@dataclass(frozen=True)
class FollowedFrame:
    """A frame, and what the face does in it."""

    frame: Frame
    motion: FaceMotion


def follow(images: Sequence[DisplayImage], tracker: Tracker) -> list[FollowedFrame]:
    """Follow the face through frames as the program does.

    Raises:
        SubjectError: no face is found in the last one.
    """
    follower = make_follower(TrackerSettings(), tracker)
    tracker.reset()
    followed = []
    for index, image in enumerate(images):
        time_s = index * FRAME_INTERVAL_S
        frame = Frame(image, index, time_s, time_s)
        followed.append(FollowedFrame(frame, follower.follow(tracker.track(frame), frame.size, time_s)))
    tracker.reset()
    if followed[-1].motion.pose is None:
        raise SubjectError("no face is found in the simulated webcam frames", "give a person who looks to the camera")
    return followed


class LiveRatio:
    """Mode live with one subject, after it has seen some frames.

    Attributes:
        residual: how badly the estimated light explains the face (see `RoomLightEstimate`).
    """

    def __init__(self, subject: Subject, tracker: Tracker, followed: Sequence[FollowedFrame]) -> None:
        """Estimate the room's light from the frames.

        Raises:
            SubjectError: there is no face in the subject's picture.
        """
        face = find_source_face(subject, tracker)
        estimator = RoomLightEstimator(subject, face)
        compared, compared_face = as_large_as_needed(subject, face)
        self._relighter = BasisRelighter(compared)
        self._relighting = RatioRelighting(compared, compared_face, DenseMotion(SessionOptions("cpu")))
        self._gain = np.float32(subject.metadata.display_gain)
        for each in followed:
            assert each.motion.pose is not None
            self._turn = face.turn_to(each.motion.pose)
            room = estimator.update(each.frame.image, each.motion.landmarks, self._turn, each.frame.time_s)
        self._room, self._last = room, followed[-1]
        self.residual = room.residual
        pose = self._last.motion.pose
        assert pose is not None
        self._eye_distance = face.scheme.eye_span(self._last.motion.landmarks)
        self._positions = self._relighting.positions(self._last.motion, pose, self._last.frame.size)

    def relit(self, light: LightMap) -> DisplayImage:
        """The last frame, as the program shows it in a light in display exposure."""
        maps = np.stack([rotate_light_map(light, self._turn) * self._gain, self._room.in_head_frame(self._turn)])
        pictures = self._relighting.raised_lights(*self._relighter.relight(maps))
        face = FaceLight(self._room.gain, self._room.cast(), pictures, self._positions, self._eye_distance)
        rest = self._relighting.mean_factor(pictures, self._room.gain)
        frame, presence = self._last.frame, float(self._last.motion.presence)
        aligned = self._relighting.aligned(frame, face, presence)
        plan = FramePlan(frame, rest, FacePlan(self._relighting, aligned, presence))
        return FrameRelighting().apply(plan).picture()
