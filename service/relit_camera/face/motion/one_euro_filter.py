"""The One-Euro filter (Casiez, Roussel and Vogel, CHI 2012) on vectors and rotations, with a soft dead band.

The constants for pose and expression are `FaceSmoothing`.

A low-pass filter whose cutoff rises with speed, `cutoff = min_cutoff + beta * speed`: little jitter at rest, little
delay in motion. The dead band removes the remaining jitter: the output is constant while the filtered value stays
within the band around it. It leaves the band without a step: the fraction of the difference that the output follows
grows from 0 at the edge of the band to 1 at twice the band.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Vectors = NDArray[np.float64]
Value = TypeVar("Value")

_NO_BAND = 1e-12
"""Added to the dead band, for one of zero."""


@dataclass(frozen=True)
class OneEuroParameters:
    """Settings of a One-Euro filter; each a number, or an array (..., 1) with a value for each vector.

    Attributes:
        min_cutoff_hz: cutoff at rest; lower means less jitter.
        beta: hertz of cutoff per unit of speed (the value's unit per second); higher means less delay.
        dead_band: radius, in the value's unit, within which the output is constant.
        speed_cutoff_hz: cutoff of the low-pass on the speed.
    """

    min_cutoff_hz: float | NDArray[np.float64] = 1.0
    beta: float | NDArray[np.float64] = 0.0
    dead_band: float | NDArray[np.float64] = 0.0
    speed_cutoff_hz: float = 1.0


@dataclass(frozen=True)
class FaceSmoothing:
    """Smoothing of pose and expression, chosen on tracked videos of still and of talking people (docs/trackers.md).

    `tests/face/test_face_follower.py` and `relit evaluate video --pose` measure what it leaves of jitter and delay.

    Attributes:
        rotation: of the head's rotation, in degrees.
        translation: of the head's position, in centimetres, each axis for itself.
        expression: of the head-space points, in centimetres.
        fast_expression: of the head-space points of eyes and lips, so that blinks and speech keep their speed.
        low_noise_eye_span_px: distance of the outer eye corners from which landmarks have the least noise; on smaller
            faces dead bands grow in proportion.
        low_noise_depth_cm: depth up to which the error of depth equals that of the position across; beyond it the
            depth's dead band grows in proportion.
    """

    rotation: OneEuroParameters = OneEuroParameters(min_cutoff_hz=1.5, beta=0.8, dead_band=0.25, speed_cutoff_hz=2.5)
    translation: OneEuroParameters = OneEuroParameters(min_cutoff_hz=1.5, beta=4.0, dead_band=0.02, speed_cutoff_hz=2.5)
    expression: OneEuroParameters = OneEuroParameters(min_cutoff_hz=1.5, beta=5.0, dead_band=0.02, speed_cutoff_hz=2.5)
    fast_expression: OneEuroParameters = OneEuroParameters(
        min_cutoff_hz=4.0, beta=12.0, dead_band=0.02, speed_cutoff_hz=2.5
    )
    low_noise_eye_span_px: float = 120.0
    low_noise_depth_cm: float = 8.0


FACE_SMOOTHING = FaceSmoothing()


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
            gain = 1 / (1 + 1 / (2 * math.pi * step_s * smoothing.speed_cutoff_hz))
            velocity = self._velocity + gain * (velocity - self._velocity)
        # The weight of the new value in a first-order low-pass filter is c / (c + 1), c = 2π · cutoff · step.
        radians = (smoothing.min_cutoff_hz + smoothing.beta / noise * _norm(velocity)) * (2 * math.pi * step_s)
        change = self._between(self._filtered, value)
        self._filtered = self._moved(self._filtered, radians / (radians + 1) * change)
        self._output = self._moved(self._output, self._beyond_band(self._between(self._output, self._filtered), noise))
        self._raw, self._velocity, self._time_s = value, velocity, time_s
        return self._output

    def _beyond_band(self, change: Vectors, noise: float | Vectors) -> Vectors:
        bands = _norm(change) / (self._smoothing.dead_band * noise + _NO_BAND) - 1
        return np.asarray(change * np.minimum(np.maximum(bands, 0), 1))

    @abstractmethod
    def _between(self, start: Value, end: Value) -> Vectors:
        """The difference vector from `start` to `end`."""

    @abstractmethod
    def _moved(self, start: Value, way: Vectors) -> Value:
        """`start` moved by the difference `way`."""


class OneEuroFilter(_OneEuro[Vectors]):
    """Filters arrays (..., d) of vectors. Independent numbers are given as vectors (..., 1)."""

    def _between(self, start: Vectors, end: Vectors) -> Vectors:
        return end - start

    def _moved(self, start: Vectors, way: Vectors) -> Vectors:
        return start + way


class RotationOneEuroFilter(_OneEuro[Matrix]):
    """Filters rotation matrices (3, 3); speeds and the dead band are in degrees.

    Matrices, since scipy's `Rotation` objects would take more time than all else that is done with a face's motion.
    """

    def _between(self, start: Matrix, end: Matrix) -> Vectors:
        return np.asarray(np.degrees(cv2.Rodrigues(start.T @ end)[0][:, 0]))

    def _moved(self, start: Matrix, way: Vectors) -> Matrix:
        return np.asarray(start @ cv2.Rodrigues(np.radians(way))[0])


def _norm(vectors: Vectors) -> Vectors:
    return np.asarray(np.sqrt(np.vecdot(vectors, vectors))[..., None])
