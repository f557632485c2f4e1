"""Directions on the sphere and the 64 x 32 light-map grid.

Convention (thesis 2.3; fixed for the whole project): right-handed axes, X right in the picture, Y up, Z toward the
camera. Azimuth θ = atan2(x, z), elevation φ = asin(y), so θ = 90°, φ = 0° is light from the picture's right: (1, 0, 0).
A light map has row 0 up; texel (i, j) is centred at φ = π(½ − (i+½)/H), θ = 2π((j+½)/W − ½): the middle of the map is
the direction toward the camera and its seam is behind the subject.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAP_HEIGHT = 32
MAP_WIDTH = 64

Floats = NDArray[np.float64]


def spherical_from_direction(direction: ArrayLike) -> tuple[Floats, Floats]:
    """Azimuth and elevation, in radians, of vectors (..., 3) of any positive length. Returns two arrays (...)."""
    vector = np.asarray(direction, dtype=np.float64)
    azimuth = np.arctan2(vector[..., 0], vector[..., 2])
    # atan2 rather than asin: exact near the poles, and no domain error at a norm of 1 + 1e-16.
    elevation = np.arctan2(vector[..., 1], np.hypot(vector[..., 0], vector[..., 2]))
    return azimuth, elevation


def direction_from_spherical(azimuth: ArrayLike, elevation: ArrayLike) -> Floats:
    """Unit vectors (..., 3) from azimuth and elevation in radians. (π/2, 0) is (1, 0, 0)."""
    theta, phi = np.asarray(azimuth, np.float64), np.asarray(elevation, np.float64)
    parts = np.sin(theta) * np.cos(phi), np.sin(phi), np.cos(theta) * np.cos(phi)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def direction_from_degrees(azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> Floats:
    """Unit vectors (..., 3) from azimuth and elevation in degrees. (90, 0) is (1, 0, 0)."""
    return direction_from_spherical(np.radians(azimuth_deg), np.radians(elevation_deg))


def bearing_from_direction(direction: ArrayLike) -> tuple[Floats, Floats]:
    """Bearing in the picture, counter-clockwise from its right, and height over its plane toward the camera.

    Both in radians, (...), of vectors (..., 3) of any positive length: (0, 1, 0) has (π/2, 0), (0, 0, 1) has (0, π/2).
    """
    vector = np.asarray(direction, dtype=np.float64)
    bearing = np.arctan2(vector[..., 1], vector[..., 0])
    return bearing, np.arctan2(vector[..., 2], np.hypot(vector[..., 0], vector[..., 1]))


def fibonacci_directions(count: int) -> Floats:
    """Unit vectors (count, 3) spread evenly over the sphere, from the top down (golden spiral; Vogel 1979)."""
    y = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - y * y)
    return np.stack([radius * np.sin(angle), y, radius * np.cos(angle)], axis=1)


@lru_cache(maxsize=8)
def texel_directions(height: int = MAP_HEIGHT, width: int = MAP_WIDTH) -> Floats:
    """Unit vectors (height, width, 3) toward the texel centres. Read-only."""
    azimuth = 2 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    elevation = np.pi * (0.5 - (np.arange(height) + 0.5) / height)
    directions = direction_from_spherical(azimuth[None, :], elevation[:, None])
    directions.setflags(write=False)
    return directions


@lru_cache(maxsize=8)
def texel_solid_angles(height: int = MAP_HEIGHT, width: int = MAP_WIDTH) -> Floats:
    """Solid angles (height, width) in steradians, exact, summing to 4π. Read-only."""
    edges = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
    rows = (2 * np.pi / width) * (edges[:-1] - edges[1:])
    angles = np.repeat(rows[:, None], width, axis=1)
    angles.setflags(write=False)
    return angles


def map_position_from_direction(
    direction: ArrayLike, height: int = MAP_HEIGHT, width: int = MAP_WIDTH
) -> tuple[Floats, Floats]:
    """Continuous (row, column) on a map of vectors (..., 3); texel centres are at integers.

    The column lies in [-½, width - ½), the row in [-½, height - ½].
    """
    azimuth, elevation = spherical_from_direction(direction)
    column = np.mod(azimuth / (2 * np.pi) + 0.5, 1.0) * width - 0.5
    row = (0.5 - elevation / np.pi) * height - 0.5
    return row, column
