"""Timing of the torch's flashes, and the fraction of each row's exposure that they light.

A phone's shutter rolls: row after row is exposed for the same time, each a little later than the one above. A torch
that blinks on its own clock is then on for a fraction of the exposure that differs from row to row: whole frames, dark
frames, and frames with a band between (thesis 4.3.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

BRIGHT, DARK, PARTIAL = "bright", "dark", "partial"
_WHOLE = 0.98
"""Fraction of every row's exposure from which a frame counts as bright; below 1 minus this it counts as dark."""


@dataclass(frozen=True)
class FlashSchedule:
    """Periodic flashes: the torch is on for the fraction `duty` of each period, for the first time at `phase_s`."""

    frequency_hz: float
    duty: float
    phase_s: float

    def lit_seconds(self, start_s: ArrayLike, end_s: ArrayLike) -> NDArray[np.float64]:
        """Seconds (...) for which the torch is on within time intervals (...)."""
        return self._lit_until(end_s) - self._lit_until(start_s)

    def switching_times(self, start_s: float, end_s: float) -> NDArray[np.float64]:
        """Times (count,) within an interval at which the torch goes on or off."""
        first, last = (int(np.floor((t - self.phase_s) * self.frequency_hz)) for t in (start_s, end_s))
        periods = np.arange(first - 1, last + 2)
        times = np.sort(np.concatenate([periods, periods + self.duty])) / self.frequency_hz + self.phase_s
        return times[(times > start_s) & (times < end_s)]

    def _lit_until(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Seconds of light since the first flash, an antiderivative used through its differences."""
        period = (np.asarray(time_s, np.float64) - self.phase_s) * self.frequency_hz
        whole = np.floor(period)
        return np.asarray((whole * self.duty + np.minimum(period - whole, self.duty)) / self.frequency_hz)


@dataclass(frozen=True)
class RollingShutter:
    """Exposure of frame i's height y (0 the top edge): from i / fps + y / height · readout_s, for exposure_s."""

    fps: float
    exposure_s: float
    readout_s: float
    height: int

    def lit_fraction(self, schedule: FlashSchedule, index: int) -> NDArray[np.float64]:
        """Share 0..1 (height,) of each row's exposure for which the torch is on."""
        return self._fraction(schedule, index, np.arange(self.height) + 0.5)

    def lit_knots(self, schedule: FlashSchedule, index: int) -> list[tuple[float, float]]:
        """The lit fraction as exact knots (y in pixels, fraction), from y = 0 to height; it is linear between them."""
        start = index / self.fps
        switches = schedule.switching_times(start, start + self.readout_s + self.exposure_s)
        crossed = np.concatenate([switches - start, switches - start - self.exposure_s])
        heights = crossed / self.readout_s * self.height if self.readout_s else np.empty(0)
        inside = heights[(heights > 0) & (heights < self.height)]
        y = np.unique(np.concatenate([[0.0], inside, [float(self.height)]]))
        return list(zip(y.tolist(), self._fraction(schedule, index, y).tolist(), strict=True))

    def _fraction(self, schedule: FlashSchedule, index: int, y: NDArray) -> NDArray[np.float64]:
        start = index / self.fps + self.readout_s * y / self.height
        return schedule.lit_seconds(start, start + self.exposure_s) / self.exposure_s


def flash_state(fraction: NDArray[np.float64]) -> str:
    """State `bright`, `dark` or `partial` of a frame with these lit fractions of its rows."""
    if fraction.min() >= _WHOLE:
        return BRIGHT
    return DARK if fraction.max() <= 1 - _WHOLE else PARTIAL
