"""A webcam: automatics that follow the middle of the picture with some delay, white balance that drifts, and noise."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_studio.processing import Automatics, Gains, Sensor
from relit_studio.random_walk import RandomWalk

SENSOR = Sensor(white=0.25, shot=3e-4, read=1.2e-3)
"""Made for a room by day: in a dark one the gain, and with it the noise, goes up."""
_AUTOMATICS = Automatics(pull=0.035, momentum=0.6, exposure_limit_ev=2.5, balance_limit=0.2)
_WANTED = 0.25
"""Luminance that the exposure brings the middle of the picture to."""
_MIDDLE = 0.2
"""How wide that middle is: standard deviation as a share of either side."""
_TRUST = 0.5
"""Share of the picture's change of tint that is taken for a change of the light's."""
_DRIFT, _DRIFT_HZ = 0.04, (0.03, 0.2)
"""Of the logarithms of the gains of red and blue (RMS), and how fast."""
_WARM_FRAMES = 240
"""It was switched on so long before."""


class Webcam:
    """A webcam that has been looking at its scene for some seconds."""

    def __init__(self, seed: int, light: LinearImage) -> None:
        """Switch it on before scene light (h, w, 3), in the unit of rendered pictures; `seed` is of noise and drift."""
        self._seed = seed
        self._drift = RandomWalk(np.random.default_rng([seed, 1]), 2, *_DRIFT_HZ)
        self._tint = np.asarray(self._mean(light) / luminance(self._mean(light)))
        self.gains = Gains()
        self.follow(light, _WARM_FRAMES)

    def set_at(self, time_s: float) -> Gains:
        """What it has set for the frame at a time: as its automatics stand, and the drift."""
        drift = _DRIFT * self._drift.at(time_s)
        red, blue = (each + float(more) for each, more in zip(self.gains.balance, drift, strict=True))
        return replace(self.gains, balance=(red, blue))

    def develop(self, light: LinearImage, gains: Gains, index: int) -> DisplayImage:
        """The picture (h, w, 3) uint8 sRGB of scene light; frame `index` chooses the noise."""
        return uint8_from_linear(gains.apply(SENSOR.noisy(light * np.float32(SENSOR.white), (self._seed, 2, index))))

    def follow(self, light: LinearImage, frames: int = 1) -> None:
        """Let the automatics follow this scene light for so many frames at 24 a second."""
        mean = self._mean(light)
        wanted = self._tint * _WANTED
        # What looks tinted may be so: it goes part of the way.
        trusted = wanted * (mean / wanted) ** (1 - _TRUST)
        for _ in range(frames):
            self.gains = _AUTOMATICS.expose(self.gains, mean, wanted)
            self.gains = _AUTOMATICS.balance(self.gains, mean, trusted)

    def _mean(self, light: LinearImage) -> NDArray[np.float32]:
        """Sensor values (3,): the mean over the middle of the picture; what is too bright counts as white."""
        height, width = light.shape[:2]
        down, across = cv2.getGaussianKernel(height, _MIDDLE * height), cv2.getGaussianKernel(width, _MIDDLE * width)
        seen = np.clip(light * np.float32(SENSOR.white), 0, 1)
        mean = np.einsum("h,w,hwc->c", down[:, 0], across[:, 0], seen)
        return np.asarray(np.maximum(mean, 1e-4), np.float32)
