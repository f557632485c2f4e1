"""Relighting the subject as the scene says: the scene's light, turned with the head, on the subject."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from relit_camera.base.images.image_types import LinearImage
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.relighting.relighter import Relighter
from relit_camera.subject.subject import Subject


class SceneRelighting:
    """Relights one subject frame by frame. Not thread-safe."""

    def __init__(self, subject: Subject, relighter: Relighter, light: LightTransition, timer: StageTimer) -> None:
        """`light` goes on from subject to subject, so that a change of light stays smooth."""
        self._gain = np.float32(subject.metadata.display_gain)
        self._relighter = relighter
        self._light = light
        self._timer = timer
        self._last: tuple[LightMap, LinearImage] | None = None

    def relight(self, scene: Scene, rotation: Rotation, time_s: float) -> LinearImage:
        """The subject under the scene's light: float32 linear, the subject's size, in display exposure.

        The same picture again while neither the light nor the head has moved; it must not be written to.

        Args:
            scene: what to show.
            rotation: of the head since neutral; the light stays where it is in the room.
            time_s: of the frame.
        """
        with self._timer.stage("light"):
            light = rotate_light_map(self._light.update(scene, time_s), rotation)
        with self._timer.stage("relight"):
            light = light * self._gain
            if self._last is None or not np.array_equal(self._last[0], light):
                self._last = (light, self._relighter.relight(light[None])[0])
            return self._last[1]
