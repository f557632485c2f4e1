"""Shapes whose normals, depth and shadows are formulas."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.directions import fibonacci_directions


def front_lights(count: int = 60, lowest_z: float = 0.25) -> NDArray[np.float64]:
    """Unit vectors (some, 3), all from before the subject."""
    directions = fibonacci_directions(count * 2)
    return directions[directions[:, 2] > lowest_z]


def ball(size: int = 48) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Unit normals (size, size, 3) of a ball that nearly fills the picture, and its matte."""
    x, y = np.meshgrid((np.arange(size) + 0.5) / size * 2 - 1, 1 - (np.arange(size) + 0.5) / size * 2)
    x, y = x / 0.9, y / 0.9
    inside = x * x + y * y < 0.98
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)
    normals[~inside] = (0, 0, 1)
    return normals.astype(np.float32), inside.astype(np.float32)


def lambert(
    normals: NDArray[np.float32], matte: NDArray[np.float32], albedo: NDArray, directions: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Pictures (lights, height, width, 3) of a surface of one albedo (3,) without shadows cast."""
    shade = np.maximum(np.einsum("hwc,lc->lhw", normals, directions), 0) * matte
    return (shade[..., None] * albedo).astype(np.float32)


def angles_deg(normals: NDArray, truth: NDArray, inside: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Angles (pixels,) between unit normals (height, width, 3) inside."""
    return np.degrees(np.arccos(np.clip((normals * truth).sum(axis=2)[inside], -1, 1)))
