"""What a phone does to its pictures, each stage for itself: exposure, white balance, noise, the tone curve.

Automatic exposure and white balance follow the picture they made last, overshoot and come back: in a flashing light
they hunt, which is why plain ambient subtraction makes faces blue (thesis 4.3.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.space.colour import luminance, uint8_from_linear
from relit_camera.space.images import DisplayImage, LinearImage

EXPOSURE = 0.85
"""Sensor value of a white wall under unit irradiance before any gain; 1 is full."""

_SHOT, _READ = 1.5e-4, 1.2e-3
"""Noise variance per sensor value, and the sensor's own standard deviation, in linear values."""
_PULL, _MOMENTUM = 0.10, 0.72
"""Share of the error that is put right each frame, and of the last change that goes on: it rings."""
_EXPOSURE_LIMIT_EV, _BALANCE_LIMIT = 0.6, 0.25
"""Of the exposure in stops, and of the logarithm of the gains of red and blue."""


@dataclass(frozen=True)
class Stages:
    """Which parts of the processing are on; H.264 is the file's part."""

    gamma: bool = True
    noise: bool = True
    auto_exposure: bool = True
    white_balance: bool = True
    h264: bool = True


@dataclass(frozen=True)
class Gains:
    """What the phone has set for a frame, and how these settings are moving.

    Attributes:
        exposure_ev: exposure relative to the fixed one, in stops.
        exposure_speed: stops a frame.
        balance: natural logarithms of the gains of red and blue; green's is 1.
        balance_speed: the same a frame.
    """

    exposure_ev: float = 0.0
    exposure_speed: float = 0.0
    balance: tuple[float, float] = (0.0, 0.0)
    balance_speed: tuple[float, float] = (0.0, 0.0)

    @property
    def exposure(self) -> float:
        """Linear gain of the exposure."""
        return float(2.0**self.exposure_ev)

    @property
    def white_balance(self) -> tuple[float, float, float]:
        """Linear gains of red, green and blue."""
        return float(np.exp(self.balance[0])), 1.0, float(np.exp(self.balance[1]))


class Phone:
    """A phone's processing with some stages on."""

    def __init__(self, stages: Stages, seed: int, mean: NDArray[np.float32]) -> None:
        """Switch a phone on.

        Args:
            stages: which are on.
            seed: of the noise.
            mean: linear RGB (3,) of an ordinary picture of this scene: there the automatics rest.
        """
        self._stages, self._seed, self._mean = stages, seed, mean

    def develop(self, light: LinearImage, gains: Gains, index: int) -> DisplayImage:
        """The picture (height, width, 3) uint8 of scene light; frame `index` chooses the noise."""
        value = light * np.float32(EXPOSURE)
        if self._stages.noise:
            # What a gain makes up for, the sensor did not get: noise grows with it.
            gathered = np.maximum(value, 0)
            rng = np.random.default_rng([self._seed, 3, index])
            spread = np.sqrt(_SHOT * gathered + _READ**2, dtype=np.float32)
            value = value + spread * rng.standard_normal(value.shape, np.float32)
        value = value * np.float32(gains.exposure) * np.array(gains.white_balance, np.float32)
        if self._stages.gamma:
            return uint8_from_linear(value)
        return np.asarray(np.round(np.clip(value, 0, 1) * 255), np.uint8)

    def settle(self, gains: Gains, light: LinearImage) -> Gains:
        """The gains of the next frame, after one of this scene light was taken with `gains`."""
        mean = np.maximum(light.mean(axis=(0, 1)), 1e-6)
        if self._stages.auto_exposure:
            wanted = np.log2(luminance(self._mean) / luminance(mean))
            moved = _pulled(gains.exposure_ev, gains.exposure_speed, wanted, _EXPOSURE_LIMIT_EV)
            gains = replace(gains, exposure_ev=float(moved), exposure_speed=float(moved - gains.exposure_ev))
        if self._stages.white_balance:
            # Toward grey: red and blue as much as green.
            seen = np.log(mean / self._mean)
            moved = _pulled(gains.balance, gains.balance_speed, seen[1] - seen[[0, 2]], _BALANCE_LIMIT)
            gains = replace(gains, balance=_pair(moved), balance_speed=_pair(moved - gains.balance))
        return gains


def _pulled(setting: ArrayLike, speed: ArrayLike, wanted: ArrayLike, limit: float) -> NDArray[np.float64]:
    """The next settings (...), drawn toward what is wanted (...); they overshoot."""
    setting, speed, wanted = (np.asarray(values, np.float64) for values in (setting, speed, wanted))
    return np.clip(setting + _MOMENTUM * speed + _PULL * (wanted - setting), -limit, limit)


def _pair(values: NDArray) -> tuple[float, float]:
    return float(values[0]), float(values[1])
