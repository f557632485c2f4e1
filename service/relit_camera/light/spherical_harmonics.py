"""Spherical harmonics of light maps: what a light model of few coefficients keeps of an environment (thesis 7).

Real, orthonormal harmonics; the azimuth is θ about the Y axis, the polar angle is counted from +Y.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.light.directions import spherical_from_direction, texel_directions, texel_solid_angles
from relit_camera.light.light_map import LightMap

Floats = NDArray[np.float64]


def coefficient_count(degree: int) -> int:
    """Coefficients a channel of harmonics up to and including `degree`: 9 for 2, as learned relighting has them."""
    return (degree + 1) ** 2


def basis(directions: ArrayLike, degree: int) -> Floats:
    """Harmonics (..., (degree + 1)²) at unit vectors (..., 3), in the order l² + l + m."""
    azimuth, elevation = spherical_from_direction(directions)
    values = np.empty((*azimuth.shape, coefficient_count(degree)))
    for m in range(degree + 1):
        along, across = np.cos(m * azimuth), np.sin(m * azimuth)
        for l, legendre in enumerate(_normalized_legendre(np.sin(elevation), m, degree), start=m):  # noqa: E741
            values[..., l * l + l + m] = legendre * along
            if m:
                values[..., l * l + l - m] = legendre * across
    return values


def _normalized_legendre(x: Floats, m: int, degree: int) -> Iterator[Floats]:
    """Associated Legendre functions of order `m` and degrees m to `degree`, without the Condon-Shortley sign.

    They are normalized for real harmonics. By the recurrence of Holmes and Featherstone, J. Geodesy 76 (2002), eq. 11.
    """
    first = np.sqrt((2 if m else 1) / (4 * np.pi) * np.prod([(2 * k + 1) / (2 * k) for k in range(1, m + 1)]))
    before, now = np.zeros_like(x), first * (1 - x * x) ** (m / 2)
    yield now
    for l in range(m + 1, degree + 1):  # noqa: E741
        a = np.sqrt((2 * l - 1) * (2 * l + 1) / ((l - m) * (l + m)))
        b = np.sqrt((2 * l + 1) * (l + m - 1) * (l - m - 1) / ((l - m) * (l + m) * (2 * l - 3))) if l > m + 1 else 0.0
        before, now = now, a * x * now - b * before
        yield now


def project(light_map: LightMap, degree: int) -> Floats:
    """Coefficients ((degree + 1)², 3) that come nearest to a light map, by solid angle.

    A least-squares fit, which for the exact integral is the projection; over texels it also returns exactly what has
    no more than these harmonics.
    """
    harmonics, weights = texel_basis(degree), np.sqrt(texel_solid_angles().reshape(-1, 1))
    fitted = np.linalg.lstsq(harmonics * weights, light_map.reshape(-1, 3).astype(np.float64) * weights, rcond=None)
    return np.asarray(fitted[0], np.float64)


def reconstruct(coefficients: Floats) -> LightMap:
    """The light map of coefficients ((degree + 1)², 3), as lamps could give it.

    Negative light is cut off, and each channel scaled so that its energy Σ E·ω stays that of the coefficients: the
    more a series rings, the more brightness the cut alone would add.
    """
    degree = int(np.sqrt(len(coefficients))) - 1
    radiance = np.maximum(texel_basis(degree) @ coefficients, 0)
    energy, wanted = texel_solid_angles().ravel() @ radiance, np.sqrt(4 * np.pi) * np.maximum(coefficients[0], 0)
    radiance *= np.divide(wanted, energy, out=np.zeros(3), where=energy > 0)
    return radiance.reshape(*texel_directions().shape).astype(np.float32)


@lru_cache(maxsize=8)
def texel_basis(degree: int) -> Floats:
    """Harmonics (2048, (degree + 1)²) of the texels' directions; not to be written to."""
    harmonics = basis(texel_directions().reshape(-1, 3), degree)
    harmonics.setflags(write=False)
    return harmonics
