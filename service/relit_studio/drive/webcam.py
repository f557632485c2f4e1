"""Simulated webcam: delayed automatic exposure, automatic and drifting white balance, and noise."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_studio.base.random_walk import RandomWalk
from relit_studio.cameras.camera_simulation import AutoControls, Gains, Sensor

SENSOR = Sensor(white=0.25, shot=3e-4, read=1.2e-3)
"""Sensor suited to a room by day; in a dark room gain and noise rise."""
_AUTO_CONTROLS = AutoControls(pull=0.035, momentum=0.6, exposure_limit_ev=2.5, balance_limit=0.2)
_WANTED = 0.25
"""Target luminance of the middle of the picture."""
_MIDDLE = 0.2
"""Size of the metered middle: standard deviation of its weights as a fraction of each side."""
_TRUST = 0.5
"""Fraction of the picture's change of tint that white balance attributes to the light."""
_DRIFT, _DRIFT_HZ = 0.04, (0.03, 0.2)
"""White balance drift: RMS of the logarithms of the red and blue gains, and the band of frequencies."""
_WARM_FRAMES = 240
"""Frames for which the webcam runs before the video begins."""


class Webcam:
    """Webcam whose exposure and white balance have settled on the scene."""

    def __init__(self, seed: int, light: LinearImage) -> None:
        """Switch it on before scene light (h, w, 3), in the unit of rendered pictures; `seed` is of noise and drift."""
        self._seed = seed
        self._drift = RandomWalk(np.random.default_rng([seed, 1]), 2, *_DRIFT_HZ)
        self._tint = np.asarray(self._mean(light) / luminance(self._mean(light)))
        self.gains = Gains()
        self.follow(light, _WARM_FRAMES)

    def set_at(self, time_s: float) -> Gains:
        """Gains for the frame at a time: the current auto controls, and the drift."""
        drift = _DRIFT * self._drift.at(time_s)
        red, blue = (each + float(more) for each, more in zip(self.gains.balance, drift, strict=True))
        return replace(self.gains, balance=(red, blue))

    def develop(self, light: LinearImage, gains: Gains, index: int) -> DisplayImage:
        """The picture (h, w, 3) uint8 sRGB of scene light; frame `index` chooses the noise."""
        return uint8_from_linear(gains.apply(SENSOR.noisy(light * np.float32(SENSOR.white), (self._seed, 2, index))))

    def follow(self, light: LinearImage, frames: int = 1) -> None:
        """Let the auto controls follow this scene light for so many frames at 24 a second."""
        mean = self._mean(light)
        wanted = self._tint * _WANTED
        # The scene itself may be tinted, so correct only part of it.
        trusted = wanted * (mean / wanted) ** (1 - _TRUST)
        for _ in range(frames):
            self.gains = _AUTO_CONTROLS.expose(self.gains, mean, wanted)
            self.gains = _AUTO_CONTROLS.balance(self.gains, mean, trusted)

    def _mean(self, light: LinearImage) -> NDArray[np.float32]:
        """Mean sensor values (3,) over the middle of the picture, clipped at white."""
        height, width = light.shape[:2]
        down, across = cv2.getGaussianKernel(height, _MIDDLE * height), cv2.getGaussianKernel(width, _MIDDLE * width)
        seen = np.clip(light * np.float32(SENSOR.white), 0, 1)
        mean = np.einsum("h,w,hwc->c", down[:, 0], across[:, 0], seen)
        return np.asarray(np.maximum(mean, 1e-4), np.float32)
