"""A person whose truth is a formula: a white Lambertian ball, alone or with a small ball that casts a shadow on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.geometry.horizon_map import HorizonMap, compute_horizon_map
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import texel_directions
from tests.synthetic import render_sphere, sphere_surface

SIZE = 16
WALL, WALL_HIGH = 1.6, 1.5
"""Its x, and the z up to which it stands, in the ball's radii from the ball's middle."""


def lambert(directions: NDArray[np.float64], size: int = SIZE) -> OlatSamples:
    """max(0, n·l), no shadow of anything: the field is known in every direction."""
    normals, inside = sphere_surface(size)
    shade = np.maximum(np.einsum("hwc,lc->lhw", normals, directions), 0) * inside
    return OlatSamples(np.repeat(shade[..., None], 3, axis=3).astype(np.float32), directions, inside.astype(np.float32))


def shadowed(directions: NDArray[np.float64], size: int = 48) -> OlatSamples:
    """With the small ball's sharp shadow."""
    pictures = np.stack([render_sphere(light, size) for light in directions])
    return OlatSamples(pictures, directions, sphere_surface(size)[1].astype(np.float32))


def walled(directions: NDArray[np.float64], size: int = 48) -> OlatSamples:
    """With the sharp shadow of a wall at its right that stands before the picture's plane and is not in the picture."""
    spots, _ = sphere_surface(size)
    bare = lambert(directions, size)
    right, _, toward = directions.T[..., None, None]
    with np.errstate(divide="ignore"):
        lit = (right <= 0) | (spots[..., 2] + (WALL - spots[..., 0]) * toward / right > WALL_HIGH)
    return OlatSamples(bare.pictures * lit[..., None].astype(np.float32), directions, bare.matte)


def wall_horizon(size: int = 48, sectors: int = 32) -> HorizonMap:
    """Of the wall, and of the ball itself."""
    spots, inside = sphere_surface(size)
    own = compute_horizon_map(np.where(inside, spots[..., 2] * size / 2, np.nan).astype(np.float32), sectors).heights
    right = np.maximum(np.cos(2 * np.pi * np.arange(sectors) / sectors), 1e-9)
    wall = np.arctan(((WALL_HIGH - spots[..., 2]) / (WALL - spots[..., 0]))[..., None] * right)
    return HorizonMap(np.where(right > 1e-6, np.maximum(own, wall), own).astype(np.float16))


def grid(rows: int) -> NDArray[np.float64]:
    """Directions (2 rows², 3) of a light map's texels."""
    return np.array(texel_directions(rows, 2 * rows).reshape(-1, 3))


def cap(count: int, within_deg: float) -> NDArray[np.float64]:
    """Directions spread evenly over the part of the sphere about the camera's axis, its rim included."""
    index = np.arange(count) + 0.5
    z = 1 - index / count * (1 - np.cos(np.radians(within_deg)))
    angle = np.pi * (3 - np.sqrt(5)) * index
    inner = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
    around = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    radius = np.sin(np.radians(within_deg))
    rim = np.stack([radius * np.cos(around), radius * np.sin(around), np.full(16, np.cos(np.radians(within_deg)))], 1)
    return np.concatenate([inner[z > np.cos(np.radians(within_deg * 0.9))], rim])
