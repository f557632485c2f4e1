"""Small involuntary head movements of a person who tries to keep still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.rotations import Angles, Rotation, rotation_from_angles
from relit_studio.base.random_walk import RandomWalk
from relit_studio.mannequin.shape.figure import PIVOT

_ANGLES_DEG = np.array([0.7, 0.5, 0.35])
"""RMS of yaw, pitch and roll."""
_SWAY_CM = np.array([0.18, 0.1, 0.2])
"""RMS of the translation."""
_BREATH_CM, _BREATH_HZ = 0.06, 0.27


@dataclass(frozen=True, eq=False)
class Motion:
    """Displacement of the head from rest: a rotation about its pivot in the neck, then a translation.

    Attributes:
        angles: degrees, see `base.rotations`.
        translation_cm: (3,).
    """

    angles: Angles
    translation_cm: NDArray[np.float64]

    @property
    def rotation(self) -> Rotation:
        """Room from head."""
        return rotation_from_angles(*self.angles)

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Move points (..., 3) of the head, given in its axes at rest."""
        matrix = self.rotation.as_matrix()
        return np.asarray((np.asarray(points, np.float64) - PIVOT) @ matrix.T + PIVOT + self.translation_cm)

    def undo(self, points: ArrayLike) -> NDArray[np.float64]:
        """The inverse of `apply`."""
        matrix = self.rotation.as_matrix()
        return np.asarray((np.asarray(points, np.float64) - PIVOT - self.translation_cm) @ matrix + PIVOT)


REST = Motion(Angles(0.0, 0.0, 0.0), np.zeros(3))


class HeadMotion:
    """Slow random head movement with breathing, scaled by `amount`; 0 keeps the head still."""

    def __init__(self, seed: int, amount: float = 1.0) -> None:
        rng = np.random.default_rng([seed, 2])
        self._amount = amount
        self._drift = RandomWalk(rng, 6, 0.04, 0.5)
        self._breath_phase = rng.uniform(0, 2 * np.pi)

    def at(self, time_s: float) -> Motion:
        """The motion at a time."""
        values = self._drift.at(time_s)
        breath = _BREATH_CM * np.sin(2 * np.pi * _BREATH_HZ * time_s + self._breath_phase)
        sway = _SWAY_CM * values[3:] + np.array([0.0, breath, 0.0])
        return Motion(Angles(*(self._amount * _ANGLES_DEG * values[:3]).tolist()), self._amount * sway)
