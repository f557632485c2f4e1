"""The light of the scene in display exposure, and its smooth transition when the scene changes."""

from __future__ import annotations

import numpy as np

from relit_camera.base.config.look import Lighting
from relit_camera.base.easing import ease_out_cubic
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import LightMap
from relit_camera.light.scene_light import scene_light_map
from relit_camera.live.scene.scene import Scene


def display_light(environment: Environment | None, lighting: Lighting) -> LightMap:
    """The light map (32, 64, 3), float32, of environment and lamps in display exposure, with the face gain.

    The environment, rotated as the lighting says, is scaled so that a white ball facing the camera reads 0.8. Lamps are
    not scaled: their intensity is what such a ball reads, so a lamp is as bright in a night street as in a studio.
    """
    surround = scene_light_map(environment, lighting.model_copy(update={"lamps": ()}))
    lamps = scene_light_map(None, lighting)
    gain = 2.0 ** (lighting.exposure_ev + lighting.face_gain_ev)
    return np.asarray((surround * auto_exposure_scale(surround) + lamps) * gain, dtype=np.float32)


class LightTransition:
    """Blends from the present light to that of the next scene over its `transition_s`, fast at first."""

    def __init__(self) -> None:
        # Of an environment its light map: the panorama of one that is shown no more may be large.
        self._key: tuple[LightMap | None, Lighting] | None = None
        self._from: LightMap | None = None
        self._target: LightMap | None = None
        self._since = self._last = 0.0

    def update(self, scene: Scene, now: float) -> LightMap:
        """The light map to show at `now` seconds; that of the first scene is shown without a transition."""
        environment = scene.environment
        key = (None if environment is None else environment.light_map, scene.look.lighting)
        if self._key is None or key[0] is not self._key[0] or key[1] != self._key[1]:
            self._from = None if self._target is None else self._shown(self._last)
            self._target = display_light(environment, key[1])
            # The transition began at the last frame, so that this frame shows its first step.
            self._key, self._since = key, min(self._last, now)
        self._last = now
        return self._shown(now)

    def _shown(self, now: float) -> LightMap:
        assert self._target is not None
        assert self._key is not None
        share = ease_out_cubic(now - self._since, self._key[1].transition_s)
        if self._from is None or share >= 1:
            return self._target
        return np.asarray(self._from + (self._target - self._from) * np.float32(share), dtype=np.float32)
