"""Conversion from room axes (X right in the picture, Y up, Z to the camera) to Blender's (Z up, -Y to the camera)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

BLENDER_FROM_OURS = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Homogeneous matrix (4, 4)."""


def to_blender(points: ArrayLike) -> NDArray[np.float32]:
    """Points (..., 3) in Blender's axes, float32 and contiguous."""
    x, y, z = np.moveaxis(np.asarray(points), -1, 0)
    return np.ascontiguousarray(np.stack([x, -z, y], axis=-1), np.float32)


def matrix_to_blender(matrix: ArrayLike) -> NDArray[np.float64]:
    """Rigid motion (4, 4) converted from room axes to Blender's."""
    return np.asarray(BLENDER_FROM_OURS @ np.asarray(matrix, np.float64) @ BLENDER_FROM_OURS.T)
