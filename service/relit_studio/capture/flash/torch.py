"""The hand-held torch (a phone's light): its path, its aim and its irradiance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from relit_camera.light.directions import direction_from_degrees
from relit_studio.base.random_walk import RandomWalk

Vector = NDArray[np.float64]

REFERENCE_CM = 100.0
"""Distance at which the torch gives unit irradiance on its axis."""
BEAM_EXPONENT = 2.3
"""Intensity falls as cosⁿ of the angle off the axis: half at 42°, as phone torches have it."""
RADIUS_CM = 0.4
"""Radius of the luminous disc."""

_SWEEP_S = 3.7
"""Duration of one movement up and down."""
_AZIMUTH_DEG = 72.0
_LOW_DEG, _HIGH_DEG = -18.0, 68.0
_LAPSE_EVERY_S, _LAPSE_S, _LAPSE_DEG = 5.0, 0.35, 45.0
"""Aiming errors of the hand: mean interval, half their duration, and their angle."""


@dataclass(frozen=True, eq=False)
class Torch:
    """The torch at one time, in camera axes.

    Attributes:
        position: (3,) centimeters.
        aim: (3,) unit vector along which it points.
    """

    position: Vector
    aim: Vector

    def off_axis_cosine(self, points: NDArray) -> NDArray:
        """Cosine (...), at least 0, of the angle between the aim and the direction to points (..., 3)."""
        way = points - self.position.astype(points.dtype)
        cosine = way @ self.aim.astype(points.dtype) / np.linalg.norm(way, axis=-1)
        return np.asarray(np.maximum(cosine, 0))

    def irradiance(self, points: NDArray) -> NDArray:
        """Irradiance (...) at points (..., 3), on a surface that faces the torch: inverse square, times the beam."""
        squared = np.square(points - self.position.astype(points.dtype)).sum(axis=-1)
        return np.asarray(REFERENCE_CM**2 / squared * self.off_axis_cosine(points) ** BEAM_EXPONENT)

    def radiance(self, cosine: NDArray) -> NDArray:
        """Radiance (...) of the disc at these cosines off its axis."""
        intensity_per_area = REFERENCE_CM**2 / (np.pi * RADIUS_CM**2)
        return np.asarray(intensity_per_area * np.maximum(cosine, 0) ** (BEAM_EXPONENT - 1))


class HandPath:
    """Path of the hand: repeated movements up and down, from the picture's left to its right (thesis 4.3.1).

    The distance varies by about a tenth, the torch wanders a few degrees off its aim, and now and then it points far
    away for a moment.
    """

    def __init__(self, target: ArrayLike, seconds: float, seed: int, distance_cm: float = REFERENCE_CM) -> None:
        """Path around `target` (3,) of the given duration, with the seed's random deviations."""
        rng = np.random.default_rng([seed, 1])
        self._target = np.asarray(target, np.float64)
        self._seconds, self._distance_cm = seconds, distance_cm
        self._sweeps = max(1.5, seconds / _SWEEP_S)
        self._place = RandomWalk(rng, 3, 0.1, 0.7)
        self._aim = RandomWalk(rng, 2, 0.2, 1.5)
        count = int(seconds / _LAPSE_EVERY_S + rng.uniform())
        self._lapses_s = rng.uniform(0, seconds, count)
        self._lapse_sides = rng.uniform(0, 2 * np.pi, count)

    def at(self, time_s: float) -> Torch:
        """The torch at a time."""
        done = np.clip(time_s / self._seconds, 0, 1)
        aside, up, away = self._place.at(time_s)
        height = 0.5 - 0.5 * np.cos(2 * np.pi * self._sweeps * done)
        azimuth = _AZIMUTH_DEG * (2 * done - 1) + 3.0 * aside
        elevation = _LOW_DEG + (_HIGH_DEG - _LOW_DEG) * height + 2.5 * up
        distance = self._distance_cm * (1 + 0.08 * away)
        position = self._target + distance * direction_from_degrees(azimuth, elevation)
        return Torch(position, self._aim_at(time_s, position))

    def _aim_at(self, time_s: float, position: Vector) -> Vector:
        toward = (self._target - position) / np.linalg.norm(self._target - position)
        aside = np.cross([0.0, 1.0, 0.0], toward)
        aside /= np.linalg.norm(aside)
        yaw, pitch = 2.5 * self._aim.at(time_s)
        for lapse_s, side in zip(self._lapses_s, self._lapse_sides, strict=True):
            size = _LAPSE_DEG * np.exp(-(((time_s - lapse_s) / _LAPSE_S) ** 2))
            yaw, pitch = yaw + size * np.cos(side), pitch + size * np.sin(side)
        turn = np.radians(yaw) * np.cross(toward, aside) + np.radians(pitch) * aside
        return np.asarray(Rotation.from_rotvec(turn).apply(toward))
