"""GGX gloss over a diffuse base, with the energy that the gloss takes subtracted from the base."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

from relit_camera.light.directions import fibonacci_directions

Values = NDArray[np.float32]


def glossy(normals: Values, views: Values, light: ArrayLike, f0: Values, alpha: Values) -> tuple[Values, Values]:
    """Reflected light of points under a distant light of unit irradiance, without shadows.

    The gloss is GGX with Smith's height-correlated masking (Walter et al. 2007; Heitz 2014) and Schlick's Fresnel, π
    times the reflectance and the cosine, so that a white Lambert surface reads 1 in the same unit. The base is scaled
    by what the gloss leaves of light toward the camera, as Cycles does: no point gives back more than it gets.

    Args:
        normals: (count, 3) unit vectors.
        views: (count, 3) unit vectors to the camera.
        light: (3,) unit vector toward the light.
        f0: (count,) reflectance at normal incidence; 0 has no gloss.
        alpha: (count,) width.

    Returns:
        The gloss (count,), and the diffuse cosine (count,) to be multiplied by the albedo.
    """
    toward = np.asarray(light, np.float32)
    cosine = np.maximum(normals @ toward, 0)
    facing = np.maximum(np.einsum("ij,ij->i", normals, views), 1e-4)
    half = views + toward
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-6)
    lobe = _lobe(np.einsum("ij,ij->i", normals, half), cosine, facing, alpha)
    gloss = schlick(f0, np.asarray(half @ toward)) * lobe
    base = (1 - gloss_albedo(f0, alpha, facing)) * cosine
    return np.asarray(np.where(f0 > 0, gloss, 0), np.float32), np.asarray(base, np.float32)


def gloss_albedo(f0: Values, alpha: Values, cosine: NDArray) -> Values:
    """Directional albedo (count,) of the gloss: fraction of uniform light that it reflects to the camera."""
    scale, rise = _lobe_integrals()
    steps = scale.shape[0] - 1
    place = np.stack([np.clip(alpha, 0, 1) * steps, np.clip(cosine, 0, 1) * steps])
    fractions = [map_coordinates(table, place, order=1, mode="nearest") for table in (scale, rise)]
    return np.asarray(np.where(f0 > 0, f0 * fractions[0] + fractions[1], 0), np.float32)


@lru_cache(maxsize=1)
def _lobe_integrals(steps: int = 24, directions: int = 8192) -> tuple[NDArray, NDArray]:
    """The lobe's integral over the hemisphere without Schlick's rise, and with it alone, by width and cosine.

    A surface's gloss reflects f0 times the first and once the second (Karis 2013 calls it the split sum's second part).
    """
    light = fibonacci_directions(2 * directions)
    light = light[light[:, 2] > 0]
    grid = np.linspace(0, 1, steps + 1)
    scale, rise = np.empty((2, steps + 1, steps + 1))
    for column, facing in enumerate(np.maximum(grid, 0.02)):
        half = light + [np.sqrt(1 - facing**2), 0, facing]
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        fraction = (1 - np.clip((half * light).sum(axis=1), 0, 1)) ** 5
        for row, alpha in enumerate(np.maximum(grid, 0.05)):
            lobe = _lobe(half[:, 2], light[:, 2], facing, alpha)
            # Mean over the hemisphere, 2π; white-wall units have the factor π.
            scale[row, column], rise[row, column] = 2 * np.mean(lobe * (1 - fraction)), 2 * np.mean(lobe * fraction)
    return scale, rise


def _lobe(aligned: NDArray, cosine: NDArray, facing: ArrayLike, alpha: ArrayLike) -> NDArray:
    """GGX without Fresnel: π times the reflectance and the cosine. `aligned` is n·h."""
    squared = np.square(alpha)
    spread = squared / np.square(aligned * aligned * (squared - 1) + 1)
    # G / (4 n·l n·v).
    visibility = 0.5 / np.maximum(
        cosine * np.sqrt(np.square(facing) * (1 - squared) + squared)
        + np.asarray(facing) * np.sqrt(cosine * cosine * (1 - squared) + squared),
        1e-6,
    )
    return np.asarray(spread * visibility * cosine)


def schlick(f0: Values, cosine: NDArray) -> Values:
    """Fresnel reflectance (count,) at these cosines; a surface of f0 = 0 reflects at no angle."""
    rise = (1 - np.clip(cosine, 0, 1)) ** 5
    return np.asarray(np.where(f0 > 0, f0 + (1 - f0) * rise, 0), np.float32)
