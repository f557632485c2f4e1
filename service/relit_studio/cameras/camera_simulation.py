"""Simulation of a small camera: sensor noise, automatic exposure and automatic white balance.

The phone (`capture.phone`) and the webcam (`drive.webcam`) use it with different numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage


@dataclass(frozen=True)
class Sensor:
    """Image sensor with shot and read noise.

    Attributes:
        white: value of a white wall under unit irradiance before any gain; 1 is full.
        shot: noise variance per sensor value.
        read: standard deviation of the sensor's own noise.
    """

    white: float
    shot: float
    read: float

    def noisy(self, values: LinearImage, seed: Sequence[int]) -> LinearImage:
        """Sensor values (h, w, 3) with noise added; equal seeds give equal noise."""
        variance = np.float32(self.shot) * np.maximum(values, 0) + np.float32(self.read**2)
        noise = np.random.default_rng(seed).standard_normal(values.shape, np.float32)
        return np.asarray(values + np.sqrt(variance) * noise, np.float32)


@dataclass(frozen=True)
class Gains:
    """Exposure and white balance set for a frame, and how fast they are changing.

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

    def apply(self, values: LinearImage) -> LinearImage:
        """Sensor values (h, w, 3) times the gains. Noise is amplified with the signal."""
        return values * np.float32(self.exposure) * np.array(self.white_balance, np.float32)


@dataclass(frozen=True)
class AutoControls:
    """Automatic exposure and white balance, as damped control: each frame corrects part of the error, with momentum.

    Attributes:
        pull: fraction of the error that is corrected each frame.
        momentum: fraction of the last change that is repeated; large values overshoot and come back.
        exposure_limit_ev: of the exposure, in stops.
        balance_limit: of the logarithm of the gains of red and blue.
    """

    pull: float
    momentum: float
    exposure_limit_ev: float
    balance_limit: float

    def expose(self, gains: Gains, mean: NDArray, wanted: NDArray) -> Gains:
        """The next gains after a picture of mean light (3,), so that it gets as bright as the wanted mean (3,)."""
        error = np.log2(luminance(wanted) / luminance(mean))
        moved = self._pulled(gains.exposure_ev, gains.exposure_speed, error, self.exposure_limit_ev)
        return replace(gains, exposure_ev=float(moved), exposure_speed=float(moved - gains.exposure_ev))

    def balance(self, gains: Gains, mean: NDArray, wanted: NDArray) -> Gains:
        """The next gains after a picture of mean light (3,), so that it gets the tint of the wanted mean (3,)."""
        seen = np.log(mean / wanted)
        moved = self._pulled(gains.balance, gains.balance_speed, seen[1] - seen[[0, 2]], self.balance_limit)
        return replace(gains, balance=_pair(moved), balance_speed=_pair(moved - gains.balance))

    def _pulled(self, setting: ArrayLike, speed: ArrayLike, wanted: ArrayLike, limit: float) -> NDArray[np.float64]:
        """The next settings (...), moved toward the wanted ones (...)."""
        setting, speed, wanted = (np.asarray(values, np.float64) for values in (setting, speed, wanted))
        return np.clip(setting + self.momentum * speed + self.pull * (wanted - setting), -limit, limit)


def _pair(values: NDArray) -> tuple[float, float]:
    return float(values[0]), float(values[1])
