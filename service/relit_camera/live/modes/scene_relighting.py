"""Relighting the subject as the scene says: the scene's light, turned with the head, on the subject."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.rotations import Rotation
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.turn_extrapolation import TurnExtrapolation
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.relighting.relighter import Relighter
from relit_camera.subject.subject import Subject

RATIO_MORE_FRAMES, RATIO_MAX_STEP = 1, np.radians(4.0)
"""The ratio of two pictures changes less than one of them, and is seen under the texture of the live picture: while the
head turns it is computed once in so many more frames, and for a larger turn."""


class SceneRelighting:
    """Relights one subject frame by frame. Not thread-safe."""

    def __init__(self, subject: Subject, relighter: Relighter, light: LightTransition, timer: StageTimer) -> None:
        """`light` goes on from subject to subject, so that a change of light stays smooth."""
        self._relit = TurnExtrapolation()
        self._compared = TurnExtrapolation(RATIO_MAX_STEP)
        self._gain = np.float32(subject.metadata.display_gain)
        self._relighter = relighter
        self._light = light
        self._timer = timer

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
                rotation, light, None, every, lambda: self._relighter.relight(self._seen(light, rotation)[None])[0]
            )

    def compare(
        self,
        scene: Scene,
        rotation: Rotation,
        time_s: float,
        room: LightMap,
        room_in_head_frame: LightMap,
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
            room_in_head_frame: the same as the head sees it.
            combine: makes an array (height, width, 3 or 4) of non-negative values.
            every: as in `relight`; the comparison is made less often.
        """
        with self._timer.stage("light"):
            light = self._light.update(scene, time_s)

        def relit() -> NDArray[np.float32]:
            return combine(*self._relighter.relight(np.stack([self._seen(light, rotation), room_in_head_frame])))

        with self._timer.stage("relight"):
            return self._compared.picture(rotation, light, room, every + RATIO_MORE_FRAMES, relit)

    def _seen(self, light: LightMap, rotation: Rotation) -> LightMap:
        return rotate_light_map(light, rotation) * self._gain
