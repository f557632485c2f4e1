"""Scene of a capture: person, mirror balls, room and moving torch, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.exposure import WHITE_BALL_LUMINANCE, auto_exposure_scale
from relit_camera.light.light_map import LightMap
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.ball.ball_reflection import Room, room_in_balls, torch_in_ball
from relit_studio.capture.ball.mirror_ball import MirrorBall
from relit_studio.capture.flash.flash_timing import FlashSchedule, RollingShutter
from relit_studio.capture.flash.torch import HandPath, Torch
from relit_studio.capture.persons.captured_person import Person
from relit_studio.capture.persons.head_motion import HeadMotion, Motion

_BALLS_AT = ((0.7, 0.46), (-0.7, 0.4))
"""Positions of the balls at the head's distance, right and up, as fractions of half the picture."""
_BALLS_BEFORE_CM = (3.0, 1.5)
"""Distance of the balls in front of the head's origin."""
_BALL_SIZE = 0.16
"""A ball's radius as a fraction of what half the shorter side spans."""
_POLISHED = np.array([0.86, 0.85, 0.83], np.float32)


@dataclass(frozen=True)
class Timing:
    """Timing of the frames and of the torch.

    Attributes:
        seconds: length of the video.
        fps: frames a second.
        flash_hz: the torch's frequency by its own clock, which is off by `clock_error`: the phase drifts.
        duty: fraction of each period that it is on.
        exposure_s: of each row.
        readout_s: from the first row's exposure to the last one's.
    """

    seconds: float = 30.0
    fps: float = 30.0
    flash_hz: float = 5.0
    clock_error: float = 0.013
    duty: float = 0.5
    exposure_s: float = 1 / 60
    readout_s: float = 0.018

    @property
    def frames(self) -> int:
        """Number of frames."""
        return max(1, round(self.seconds * self.fps))


@dataclass(frozen=True, eq=False)
class FrameState:
    """State of the scene while a frame is taken.

    Attributes:
        index: of the frame.
        time_s: its presentation time, the start of its first row's exposure.
        motion: of the head.
        torch: its position and aim, whether it is on or off.
        lit: fraction (height,) of each row's exposure for which it is on.
        knots: the same fraction as exact knots, see `RollingShutter.lit_knots`.
    """

    index: int
    time_s: float
    motion: Motion
    torch: Torch
    lit: NDArray[np.float64]
    knots: list[tuple[float, float]]


class Scene:
    """A person, mirror balls and a room, and a torch that is moved around them."""

    def __init__(
        self, person: Person, room: Room, timing: Timing, seed: int, motion: float = 1.0, balls: int = 1
    ) -> None:
        """Set the scene.

        Args:
            person: before their own camera.
            room: its light, scaled to what is wanted beside the torch.
            timing: of frames and flashes.
            seed: of the hand, the head and the torch's phase.
            motion: scales the head's movements.
            balls: how many there are, 1 or 2.
        """
        self.person, self.room, self.timing, self.motion = person, room, timing, motion
        self.camera = person.camera
        self.balls = place_balls(person)[:balls]
        self.schedule = FlashSchedule(
            frequency_hz=timing.flash_hz * (1 + timing.clock_error),
            duty=timing.duty,
            phase_s=float(np.random.default_rng([seed, 4]).uniform(0, 1 / timing.flash_hz)),
        )
        self.shutter = RollingShutter(timing.fps, timing.exposure_s, timing.readout_s, self.camera.height)
        self._hand = HandPath(person.origin, timing.seconds, seed)
        self._head = HeadMotion(seed, motion)
        self._behind = _backdrop(self.camera, room)
        self._in_balls, self._coverage = room_in_balls(self.balls, self.camera, room)

    def frame_state(self, index: int) -> FrameState:
        """State at frame `index`."""
        time_s = index / self.timing.fps
        lit = self.shutter.lit_fraction(self.schedule, index)
        knots = self.shutter.lit_knots(self.schedule, index)
        return FrameState(index, time_s, self._head.at(time_s), self._hand.at(time_s), lit, knots)

    def light(self, state: FrameState) -> LinearImage:
        """Linear light at the camera (height, width, 3); each row contains its own fraction of the torch's light."""
        without, torch = self.parts(state)
        return without + torch * state.lit[:, None, None].astype(np.float32)

    def parts(self, state: FrameState) -> tuple[LinearImage, LinearImage]:
        """The scene without the torch, and the light that the torch adds if always on; both (height, width, 3).

        The second is black where the torch is off during the whole frame.
        """
        shining = state.torch if state.lit.any() else None
        layers = self.person.layers(state.motion, shining)
        beside_balls = 1 - self._coverage[..., None]
        without = self._behind * (1 - layers.matte[..., None]) + layers.ambient
        torch = layers.flash * beside_balls
        if shining is not None:
            for ball in self.balls:
                torch += torch_in_ball(ball, self.camera, shining)
        return without * beside_balls + self._in_balls, torch

    def ordinary_mean(self) -> NDArray[np.float32]:
        """Linear RGB (3,): geometric mean of the mean light without and with the torch, half way through the video."""
        middle = self.frame_state(self.timing.frames // 2)
        without, torch = self.parts(replace(middle, lit=np.ones_like(middle.lit)))
        dark, bright = (np.maximum(image.mean(axis=(0, 1)), 1e-6) for image in (without, without + torch))
        return np.asarray(np.sqrt(dark * bright), np.float32)


def place_balls(person: Person) -> tuple[MirrorBall, ...]:
    """Two balls of equal size beside the person's head, upper right and left, where they cast no shadow on it."""
    camera, origin = person.camera, person.origin
    half = -origin[2] * np.array([camera.width, camera.height]) / 2 / camera.focal_px
    centers = [
        np.array([at[0] * half[0], at[1] * half[1], origin[2] + before])
        for at, before in zip(_BALLS_AT, _BALLS_BEFORE_CM, strict=True)
    ]
    return tuple(MirrorBall(center, float(_BALL_SIZE * half.min()), _POLISHED) for center in centers)


def dimmed(environment: Environment, ambient: float) -> tuple[Room, LightMap]:
    """The room and its light map, scaled so that a white ball has the value `ambient` where it faces the camera.

    The torch gives 1 at its reference distance.
    """
    scale = np.float32(auto_exposure_scale(environment.light_map) * ambient / WHITE_BALL_LUMINANCE)
    return Room(environment.panorama.radiance * scale), environment.light_map * scale


def _backdrop(camera: Pinhole, room: Room) -> LinearImage:
    """Background: the room behind the person, too far away to be lit by the torch."""
    return room.seen_along(camera.rays(*camera.pixel_grid()))
