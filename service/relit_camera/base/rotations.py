"""Rotations of head and environment.

Angles are intrinsic Y-X-Z in degrees, right-handed: yaw > 0 turns the nose to the picture's right, pitch > 0 turns it
down, roll > 0 lifts the picture's right side. A head rotation takes head-frame vectors to world-frame vectors. Worked
point: yaw 90° takes the nose (0, 0, 1) to (1, 0, 0).
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Matrix = NDArray[np.float64]
"""(3, 3)."""


_HALF_TURN_SINE = 1e-3


class AnyRotation(Protocol):
    """A rotation of this module or of scipy."""

    def as_matrix(self) -> Matrix:
        """The matrix (3, 3)."""
        ...


class Rotation:
    """One rotation, kept as its matrix; `a * b` first rotates by b.

    What a frame needs of scipy's class, by the same names, in a tenth of the time.
    """

    __array_ufunc__ = None  # so that a NumPy array times a rotation is an error
    __slots__ = ("_matrix",)

    def __init__(self, matrix: Matrix) -> None:
        """Take an orthonormal (3, 3) matrix of determinant 1; it is not checked, and must not be changed."""
        self._matrix = matrix

    @staticmethod
    def identity() -> Rotation:
        """The rotation by nothing."""
        return Rotation(np.eye(3))

    @staticmethod
    def from_rotvec(vector: ArrayLike) -> Rotation:
        """The rotation about a vector (3,) by its length in radians."""
        return Rotation(np.asarray(cv2.Rodrigues(np.asarray(vector, np.float64))[0], np.float64))

    @staticmethod
    def nearest(matrix: Matrix) -> Rotation:
        """The rotation nearest to a matrix (3, 3): of a mean of rotations, their mean."""
        left, _, right = np.linalg.svd(matrix)
        left[:, 2] *= np.linalg.det(left @ right)
        return Rotation(np.asarray(left @ right))

    def as_matrix(self) -> Matrix:
        """The matrix (3, 3); must not be written to."""
        return self._matrix

    def as_rotvec(self) -> NDArray[np.float64]:
        """The axis (3,), as long as the angle in radians."""
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._matrix.tolist()
        x, y, z, cos = (zy - yz) / 2, (xz - zx) / 2, (yx - xy) / 2, (xx + yy + zz - 1) / 2
        sin = math.hypot(x, y, z)
        if sin < _HALF_TURN_SINE and cos < 0:  # near a half turn this difference says nothing about the axis
            return np.asarray(cv2.Rodrigues(self._matrix)[0][:, 0], np.float64)
        factor = math.atan2(sin, cos) / sin if sin > 0 else 1.0
        return np.array([x * factor, y * factor, z * factor])

    def magnitude(self) -> float:
        """The angle in radians, 0..π."""
        return math.hypot(*self.as_rotvec().tolist())

    def inv(self) -> Rotation:
        """The rotation back."""
        return Rotation(self._matrix.T)

    def apply(self, vectors: ArrayLike) -> NDArray[np.float64]:
        """Rotate vectors (..., 3)."""
        return np.asarray(np.asarray(vectors, np.float64) @ self._matrix.T)

    def __mul__(self, other: AnyRotation) -> Rotation:
        """First `other`, then this one."""
        return Rotation(self._matrix @ other.as_matrix())

    def __rmul__(self, other: AnyRotation) -> Rotation:
        """First this one, then `other`, which is scipy's."""
        return Rotation(other.as_matrix() @ self._matrix)


class Angles(NamedTuple):
    """Yaw, pitch and roll in degrees."""

    yaw: float
    pitch: float
    roll: float


def rotation_from_angles(yaw_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Rotation:
    """The rotation of these intrinsic Y-X-Z angles in degrees."""
    yaw, pitch, roll = math.radians(yaw_deg), math.radians(pitch_deg), math.radians(roll_deg)
    (sy, cy), (sp, cp), (sr, cr) = ((math.sin(angle), math.cos(angle)) for angle in (yaw, pitch, roll))
    return Rotation(
        np.array(
            [
                [cy * cr + sy * sp * sr, sy * sp * cr - cy * sr, sy * cp],
                [cp * sr, cp * cr, -sp],
                [cy * sp * sr - sy * cr, sy * sr + cy * sp * cr, cy * cp],
            ]
        )
    )


def angles_from_rotation(rotation: AnyRotation) -> Angles:
    """Yaw, pitch and roll in degrees; yaw and roll in ±180, pitch in ±90."""
    (_, _, nose_x), (up_x, up_y, nose_y), (_, _, nose_z) = rotation.as_matrix().tolist()
    # Closed form, which stays finite at the gimbal lock that a garbage pose may well reach.
    pitch = math.asin(max(-1.0, min(-nose_y, 1.0)))
    return Angles(math.degrees(math.atan2(nose_x, nose_z)), math.degrees(pitch), math.degrees(math.atan2(up_x, up_y)))
