"""Image processing of a phone, in separate stages: exposure, white balance, noise, tone curve.

Automatic exposure and white balance follow the picture they made last, overshoot and come back: in a flashing light
they hunt, which is why plain ambient subtraction makes faces blue (thesis 4.3.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_studio.cameras.camera_simulation import AutoControls, Gains, Sensor

SENSOR = Sensor(white=0.85, shot=1.5e-4, read=1.2e-3)
_AUTO_CONTROLS = AutoControls(pull=0.10, momentum=0.72, exposure_limit_ev=0.6, balance_limit=0.25)


@dataclass(frozen=True)
class Stages:
    """Stages of the processing that are on. H.264 is applied when the video is written."""

    gamma: bool = True
    noise: bool = True
    auto_exposure: bool = True
    white_balance: bool = True
    h264: bool = True


class Phone:
    """Processing of a phone, with some stages on."""

    def __init__(self, stages: Stages, seed: int, mean: NDArray[np.float32]) -> None:
        """Start with default gains.

        Args:
            stages: which are on.
            seed: of the noise.
            mean: linear RGB (3,) of an ordinary picture of this scene: there the auto controls rest.
        """
        self._stages, self._seed, self._mean = stages, seed, mean

    def develop(self, light: LinearImage, gains: Gains, index: int) -> DisplayImage:
        """The picture (height, width, 3) uint8 of scene light; frame `index` chooses the noise."""
        values = light * np.float32(SENSOR.white)
        if self._stages.noise:
            values = SENSOR.noisy(values, (self._seed, 3, index))
        values = gains.apply(values)
        if self._stages.gamma:
            return uint8_from_linear(values)
        return np.asarray(np.round(np.clip(values, 0, 1) * 255), np.uint8)

    def settle(self, gains: Gains, light: LinearImage) -> Gains:
        """The gains of the next frame, after one of this scene light was taken with `gains`."""
        mean = np.maximum(light.mean(axis=(0, 1)), 1e-6)
        if self._stages.auto_exposure:
            gains = _AUTO_CONTROLS.expose(gains, mean, self._mean)
        if self._stages.white_balance:
            # Toward gray: red and blue as much as green.
            gains = _AUTO_CONTROLS.balance(gains, mean, self._mean)
        return gains
