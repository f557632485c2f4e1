"""The One-Euro filter (Casiez, Roussel and Vogel, CHI 2012) on vectors and on rotations, with a soft dead band.

A low-pass whose cutoff rises with speed: `cutoff = min_cutoff + beta * speed`, so a still person does not tremble and a
moving one is not late. What is left of the noise stops at the dead band: the output rests while the filtered value
stays within the band around it, so a still person is exactly still. It leaves the band without a step: the share of
the way that it takes grows from 0 at the band's edge to all of it at twice the band.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Vectors = NDArray[np.float64]
Value = TypeVar("Value")


@dataclass(frozen=True)
class OneEuroParameters:
    """Settings of a One-Euro filter; each a number, or an array (..., 1) with a value for each vector.

    Attributes:
        min_cutoff_hz: cutoff at rest; lower is calmer.
        beta: hertz of cutoff for each unit of speed (the value's unit a second); higher is quicker.
        dead_band: radius, in the value's unit, within which the output rests.
        speed_cutoff_hz: cutoff of the low-pass on the speed.
    """

    min_cutoff_hz: float | NDArray[np.float64] = 1.0
    beta: float | NDArray[np.float64] = 0.0
    dead_band: float | NDArray[np.float64] = 0.0
    speed_cutoff_hz: float = 1.0


class _OneEuro(ABC, Generic[Value]):
    """The filter on any value whose differences are vectors (..., d); each vector has one speed."""

    def __init__(self, smoothing: OneEuroParameters) -> None:
        self._smoothing = smoothing
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next value passes as it is."""
        self._time_s: float | None = None

    def __call__(self, value: Value, time_s: float, noise: float | Vectors = 1.0) -> Value:
        """Filter the value measured at `time_s` (seconds); the same time changes nothing, an earlier one resets.

        `noise` is how much noisier than usual the value is, for all or (..., 1) for each vector: by that factor the
        dead band grows and `beta` falls.
        """
        if self._time_s is None or time_s < self._time_s:
            self._raw = self._filtered = self._output = value
            self._velocity: Vectors | None = None
            self._time_s = time_s
            return value
        step_s = time_s - self._time_s
        if step_s == 0:
            return self._output
        smoothing = self._smoothing
        velocity = self._between(self._raw, value) / step_s
        if self._velocity is not None:
            velocity = self._velocity + _low_pass_gain(smoothing.speed_cutoff_hz, step_s) * (velocity - self._velocity)
        cutoff = smoothing.min_cutoff_hz + smoothing.beta / noise * _norm(velocity)
        change = self._between(self._filtered, value)
        self._filtered = self._moved(self._filtered, _low_pass_gain(cutoff, step_s) * change)
        self._output = self._moved(self._output, self._beyond_band(self._between(self._output, self._filtered), noise))
        self._raw, self._velocity, self._time_s = value, velocity, time_s
        return self._output

    def _beyond_band(self, change: Vectors, noise: float | Vectors) -> Vectors:
        band = np.maximum(np.asarray(self._smoothing.dead_band) * noise, 1e-12)
        return change * np.clip(_norm(change) / band - 1, 0, 1)

    @abstractmethod
    def _between(self, start: Value, end: Value) -> Vectors:
        """Measure the way from `start` to `end`."""

    @abstractmethod
    def _moved(self, start: Value, way: Vectors) -> Value:
        """Go `way` from `start`."""


class OneEuroFilter(_OneEuro[Vectors]):
    """Filters arrays (..., d) of vectors. For numbers that move apart from each other give them as (..., 1)."""

    def _between(self, start: Vectors, end: Vectors) -> Vectors:
        return end - start

    def _moved(self, start: Vectors, way: Vectors) -> Vectors:
        return start + way


class RotationOneEuroFilter(_OneEuro[Rotation]):
    """Filters a scipy `Rotation`; speeds and the dead band are in degrees."""

    def _between(self, start: Rotation, end: Rotation) -> Vectors:
        return np.asarray((start.inv() * end).as_rotvec(degrees=True))

    def _moved(self, start: Rotation, way: Vectors) -> Rotation:
        return start * Rotation.from_rotvec(way, degrees=True)


def _norm(vectors: Vectors) -> Vectors:
    return np.asarray(np.linalg.norm(vectors, axis=-1, keepdims=True))


def _low_pass_gain(cutoff_hz: ArrayLike, step_s: float) -> Vectors:
    """Share of the new value in a first-order low-pass."""
    turns = 2 * np.pi * np.asarray(cutoff_hz, dtype=np.float64) * step_s
    return np.asarray(turns / (turns + 1))
