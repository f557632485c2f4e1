"""Head and environment rotations as scipy `Rotation`.

Angles are intrinsic Y-X-Z in degrees, right-handed: yaw > 0 turns the nose to the picture's right, pitch > 0 turns it
down, roll > 0 lifts the picture's right side. A head rotation takes head-frame vectors to world-frame vectors. Worked
point: yaw 90° takes the nose (0, 0, 1) to (1, 0, 0).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


class Angles(NamedTuple):
    """Yaw, pitch and roll in degrees."""

    yaw: float
    pitch: float
    roll: float


def rotation_from_angles(yaw_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Rotation:
    """The rotation of these intrinsic Y-X-Z angles in degrees."""
    return Rotation.from_euler("YXZ", [yaw_deg, pitch_deg, roll_deg], degrees=True)


def angles_from_rotation(rotation: Rotation) -> Angles:
    """Yaw, pitch and roll in degrees; yaw and roll in ±180, pitch in ±90."""
    (_, _, nose_x), (up_x, up_y, nose_y), (_, _, nose_z) = rotation.as_matrix().tolist()
    # Closed form instead of `as_euler`, which warns at the gimbal lock that a garbage pose may well reach.
    pitch = math.asin(max(-1.0, min(-nose_y, 1.0)))
    return Angles(math.degrees(math.atan2(nose_x, nose_z)), math.degrees(pitch), math.degrees(math.atan2(up_x, up_y)))


def rotation_from_matrix(matrix: NDArray[np.float64]) -> Rotation:
    """The rotation of a matrix (3, 3) that is one but for rounding.

    A third of the time of `Rotation.from_matrix`; OpenCV takes turns below 0.0006° for none.
    """
    return Rotation.from_rotvec(cv2.Rodrigues(matrix)[0][:, 0])
