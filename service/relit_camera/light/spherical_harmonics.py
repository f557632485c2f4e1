"""Spherical harmonics of light maps: what a light model of few coefficients keeps of an environment (thesis 7).

Real, orthonormal harmonics; the azimuth is θ about the Y axis, the polar angle is counted from +Y.
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import lpmv

from relit_camera.light.directions import spherical_from_direction, texel_directions, texel_solid_angles
from relit_camera.light.light_map import LightMap

Floats = NDArray[np.float64]


def coefficient_count(degree: int) -> int:
    """Coefficients a channel of harmonics up to and including `degree`: 9 for 2, as learned relighting has them."""
    return (degree + 1) ** 2


def basis(directions: ArrayLike, degree: int) -> Floats:
    """Harmonics (..., (degree + 1)²) at unit vectors (..., 3), in the order l² + l + m."""
    azimuth, elevation = spherical_from_direction(directions)
    height = np.sin(elevation)
    values = np.empty((*azimuth.shape, coefficient_count(degree)))
    for l in range(degree + 1):  # noqa: E741
        for m in range(l + 1):
            scale = np.sqrt((2 * l + 1) / (4 * np.pi) * factorial(l - m) / factorial(l + m) * (2 if m else 1))
            # lpmv has the Condon-Shortley sign; real harmonics are written without.
            legendre = scale * (-1) ** m * lpmv(m, l, height)
            values[..., l * l + l + m] = legendre * np.cos(m * azimuth)
            if m:
                values[..., l * l + l - m] = legendre * np.sin(m * azimuth)
    return values


def project(light_map: LightMap, degree: int) -> Floats:
    """Coefficients ((degree + 1)², 3) that come nearest to a light map, by solid angle.

    A least-squares fit, which for the exact integral is the projection; over texels it also returns exactly what has
    no more than these harmonics.
    """
    harmonics, weights = _texel_basis(degree), np.sqrt(texel_solid_angles().reshape(-1, 1))
    fitted = np.linalg.lstsq(harmonics * weights, light_map.reshape(-1, 3).astype(np.float64) * weights, rcond=None)
    return np.asarray(fitted[0], np.float64)


def reconstruct(coefficients: Floats) -> LightMap:
    """The light map of coefficients ((degree + 1)², 3), as lamps could give it.

    Negative light is cut off, and each channel scaled so that its energy Σ E·ω stays that of the coefficients: the
    more a series rings, the more brightness the cut alone would add.
    """
    degree = int(np.sqrt(len(coefficients))) - 1
    radiance = np.maximum(_texel_basis(degree) @ coefficients, 0)
    energy, wanted = texel_solid_angles().ravel() @ radiance, np.sqrt(4 * np.pi) * np.maximum(coefficients[0], 0)
    radiance *= np.divide(wanted, energy, out=np.zeros(3), where=energy > 0)
    return radiance.reshape(*texel_directions().shape).astype(np.float32)


@lru_cache(maxsize=8)
def _texel_basis(degree: int) -> Floats:
    return basis(texel_directions().reshape(-1, 3), degree)
