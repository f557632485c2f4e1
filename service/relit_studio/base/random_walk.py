"""Smooth random signals, for the movement of hands and heads and for drifting camera settings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WAVES = 7


class RandomWalk:
    """Smooth random functions of time: sums of sines of random frequency and phase, each with RMS 1 and mean 0."""

    def __init__(self, rng: np.random.Generator, count: int, low_hz: float, high_hz: float) -> None:
        """Draw `count` independent functions within a band of frequencies."""
        self._frequencies = rng.uniform(low_hz, high_hz, (count, _WAVES))
        self._phases = rng.uniform(0, 2 * np.pi, (count, _WAVES))

    def at(self, time_s: float) -> NDArray[np.float64]:
        """The values (count,) at a time."""
        waves = np.sin(2 * np.pi * self._frequencies * time_s + self._phases)
        return np.asarray(waves.sum(axis=1) * np.sqrt(2 / _WAVES))
