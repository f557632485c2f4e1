"""Relighting the subject as the scene says: the scene's light, turned with the head, on the head.

The body below it does not turn with the head: it is lit as it stands in the room, and the neck in between by a mixture.
While the head turns a picture is computed in every n-th frame, and extrapolated in the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.base.rotations import Rotation
from relit_camera.face.head_pose import project
from relit_camera.light.exposure import WHITE_BALL_LUMINANCE, facing_light
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.ratio_relighting import bounded_factor
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.relighting.relighter import Relighter
from relit_camera.subject.subject import Subject

RATIO_MORE_FRAMES, RATIO_MAX_STEP = 1, np.radians(4.0)
"""The ratio of two pictures changes less than one of them, and is seen under the texture of the live picture: while the
head turns it is computed once in so many more frames, and for a larger turn."""
NECK_TOP, NECK_END = np.array([0.0, -10.0, 0.0]), np.array([0.0, -14.5, 0.0])
"""Head axes, cm: a neck turns with the head at its top, below the chin, and not at all at its end, at the collar."""
MAX_STEP = np.radians(3.5)
"""Radians: shadow edges do not move evenly over such angles, and what is computed would stand out from the rest."""
MAX_BASE = np.radians(8.0)
"""Two computed pictures further apart than this say nothing about what lies beyond them."""
_UNMOVED = 1e-6
"""Radians that no light map of 64 texels in 32 bits can tell from 0."""


@dataclass(frozen=True, eq=False)
class _SeenLight:
    """A light on the subject.

    Attributes:
        in_head_frame: (32, 64, 3) float32 as the turned head sees it, with the gain.
        in_room: the same as the body sees it, without.
        gain: factor of the light's brightness.
    """

    in_head_frame: LightMap
    in_room: LightMap
    gain: np.float32 = field(default_factory=lambda: np.float32(1))


@dataclass(frozen=True, eq=False)
class _Body:
    """The lower part of the source image under the light of the room; `light` is the map itself, to know it by."""

    light: LightMap
    picture: LinearImage


class SceneRelighting:
    """Relights one subject frame by frame. Not thread-safe."""

    def __init__(
        self, subject: Subject, face: SourceFace, relighter: Relighter, light: LightTransition, timer: StageTimer
    ) -> None:
        """Prepare for one subject.

        Args:
            subject: the person.
            face: the face in the source image.
            relighter: of that subject.
            light: goes on from subject to subject, so that a change of light stays smooth.
            timer: counts the stages `light` and `relight`.
        """
        self._relit = TurnExtrapolation()
        self._compared = TurnExtrapolation(RATIO_MAX_STEP)
        self._gain = np.float32(subject.metadata.display_gain)
        self._relighter = relighter
        self._light = light
        self._timer = timer
        body = body_fraction(face) * (subject.matte > 0)
        self._first_row = int(np.argmax(body.any(axis=1)))
        self._body = cv2.merge([body[self._first_row :]] * 3) if body.any() else None
        self._bodies: list[_Body] = []

    def relight(self, scene: Scene, rotation: Rotation, time_s: float, every: int) -> LinearImage:
        """The subject under the scene's light: float32 linear, the subject's size, in display exposure.

        The same picture again while neither the light nor the head has moved; it must not be written to.

        Args:
            scene: what to show.
            rotation: of the head since neutral; the light stays where it is in the room.
            time_s: of the frame.
            every: while the head turns, the subject is relit in every so many frames; between it is extrapolated.
        """
        with self._timer.stage("light"):
            light = self._light.update(scene, time_s)
        with self._timer.stage("relight"):
            return self._relit.picture(
                rotation, light, None, every, lambda: self._head_and_body(self._scene_light(light, rotation))[0]
            )

    def place_tint(self, scene: Scene, time_s: float) -> NDArray[np.float32]:
        """The factor (3,) that a white ball facing the camera has in the scene's light, where 0.8 is 1."""
        with self._timer.stage("light"):
            light = self._light.update(scene, time_s)
        return bounded_factor(facing_light(light) / np.float32(WHITE_BALL_LUMINANCE))

    def compare(
        self,
        scene: Scene,
        rotation: Rotation,
        time_s: float,
        room: LightMap,
        room_in_head_frame: Callable[[Rotation], LightMap],
        combine: Callable[[LinearImage, LinearImage], NDArray[np.float32]],
        every: int,
    ) -> NDArray[np.float32]:
        """What `combine` makes of the subject under the scene's light and under the room's, both of the subject's size.

        The same again while neither the lights nor the head have moved; it must not be written to.

        Args:
            scene: what to show.
            rotation: of the head since neutral.
            time_s: of the frame.
            room: the room's light map; another object for another light.
            room_in_head_frame: gives the same as a head sees it under a rotation.
            combine: makes an array (rows, columns, channels) of non-negative values.
            every: as in `relight`; the comparison is made less often.
        """
        with self._timer.stage("light"):
            light = self._light.update(scene, time_s)

        def relit() -> NDArray[np.float32]:
            seen = _SeenLight(room_in_head_frame(rotation), room)
            return combine(*self._head_and_body(self._scene_light(light, rotation), seen))

        with self._timer.stage("relight"):
            return self._compared.picture(rotation, light, room, every + RATIO_MORE_FRAMES, relit)

    def _scene_light(self, light: LightMap, rotation: Rotation) -> _SeenLight:
        return _SeenLight(rotate_light_map(light, rotation) * self._gain, light, self._gain)

    def _head_and_body(self, *lights: _SeenLight) -> list[LinearImage]:
        """The subject under each light: the head as it sees the light, the body as it stands in the room.

        The body is relit only where its light has changed, in the same product as the head.
        """
        heads = [light.in_head_frame for light in lights]
        if self._body is None:
            return list(self._relighter.relight(np.stack(heads)))
        new = [light for light in lights if not any(body.light is light.in_room for body in self._bodies)]
        pictures = self._relighter.relight(np.stack([*heads, *(light.in_room * light.gain for light in new)]))
        made = [
            _Body(light.in_room, picture[self._first_row :].copy())
            for light, picture in zip(new, pictures[len(lights) :], strict=True)
        ]
        known = [*made, *self._bodies]
        self._bodies = [next(body for body in known if body.light is light.in_room) for light in lights]
        for body, picture in zip(self._bodies, pictures, strict=False):
            lower = picture[self._first_row :]
            toward = cv2.subtract(body.picture, lower)
            cv2.add(lower, cv2.multiply(toward, self._body, dst=toward), dst=lower)
        return list(pictures[: len(lights)])


def body_fraction(face: SourceFace) -> Mask:
    """How little the pixels of the source image turn with the head: 0 on head and chin, 1 from the collar down."""
    top, end = project(np.stack([NECK_TOP, NECK_END]), face.pose, face.size).astype(np.float64)
    down = (end - top) / max(float((end - top) @ (end - top)), 1e-9)
    width, height = face.size
    across, along = (np.arange(width) + 0.5 - top[0]) * down[0], (np.arange(height) + 0.5 - top[1]) * down[1]
    return np.asarray(smoothstep(np.add.outer(along, across)), np.float32)


@dataclass(frozen=True)
class _Computed:
    rotation: Rotation
    part: object
    picture: NDArray[np.float32]


@dataclass(frozen=True)
class _Slope:
    """How the picture changed over a turn (3,), a rotation vector in the frame of the head."""

    turn: NDArray[np.float64]
    change: NDArray[np.float32]


class TurnExtrapolation:
    """Gives a picture of non-negative values for each frame; not thread-safe.

    It goes by how far the head has turned, not by time: with a head that stops, the picture stops, and a still head has
    the same picture again. It is extrapolated by no more than the turn between the last two that were computed.
    """

    def __init__(self, max_step: float = MAX_STEP) -> None:
        """Set up.

        Args:
            max_step: radians. The picture is computed at once where the head has turned further than this since the
                last one, or than half of it aside from how it turned before.
        """
        self._max_step = max_step
        self._whole: object = None
        self._latest: _Computed | None = None
        self._slope: _Slope | None = None
        self._age = 0

    def picture(
        self, rotation: Rotation, whole: object, part: object, every: int, compute: Callable[[], NDArray[np.float32]]
    ) -> NDArray[np.float32]:
        """The picture (height, width, channels) with the head under `rotation`; it must not be written to.

        Args:
            rotation: of the head.
            whole: what else the picture depends on; with another object it is computed at once.
            part: the same of what makes so little difference that the picture goes on changing as before.
            every: it is computed in every so many frames, 1 for all.
            compute: makes it.
        """
        latest = self._latest
        if latest is None or whole is not self._whole:
            computed = _Computed(rotation, part, compute())
            self._whole, self._slope = whole, None  # only now: after a failure it is tried again
            return self._keep(computed)
        step = _turn(latest.rotation, rotation)
        self._age += 1
        same = part is latest.part
        if same and np.linalg.norm(step) < _UNMOVED:
            return latest.picture
        share = self._share(step)
        lag = step if self._slope is None else step - share * self._slope.turn
        jumped = np.linalg.norm(step) > self._max_step or np.linalg.norm(lag) > self._max_step / 2
        if self._age >= every or not same or jumped:
            computed = _Computed(rotation, part, compute())
            if same:  # else the difference is not the turn's alone: the last slope still holds
                self._slope = _slope(latest, computed)
            return self._keep(computed)
        if self._slope is None or share == 0:
            return latest.picture
        beyond = cv2.scaleAdd(self._slope.change, share, latest.picture)
        return np.asarray(np.maximum(beyond, 0, out=beyond), np.float32)

    def _keep(self, computed: _Computed) -> NDArray[np.float32]:
        self._latest, self._age = computed, 0
        return computed.picture

    def _share(self, step: NDArray[np.float64]) -> float:
        """How far `step` goes along the slope's turn: -1 to 1."""
        if self._slope is None:
            return 0.0
        turn = self._slope.turn
        return float(np.clip(step @ turn / (turn @ turn), -1, 1))


def _turn(before: Rotation, after: Rotation) -> NDArray[np.float64]:
    return np.asarray((before.inv() * after).as_rotvec())


def _slope(before: _Computed, after: _Computed) -> _Slope | None:
    turn = _turn(before.rotation, after.rotation)
    if not _UNMOVED < np.linalg.norm(turn) < MAX_BASE:
        return None
    return _Slope(turn, after.picture - before.picture)
