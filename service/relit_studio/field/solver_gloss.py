"""GGX gloss over a diffuse base, with the energy that the gloss takes subtracted from the base."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Values = NDArray[np.float32]


def glossy(normals: Values, views: Values, light: ArrayLike, f0: Values, alpha: Values) -> tuple[Values, Values]:
    """What points give under a distant light of unit irradiance, without shadows.

    The gloss is GGX with Smith's height-correlated masking (Walter et al. 2007; Heitz 2014) and Schlick's Fresnel, π
    times the reflectance and the cosine, so that a white Lambert surface reads 1 in the same unit. The base passes on
    what neither the light's nor the camera's Fresnel reflection took: no point gives back more than it gets.

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
    aligned = np.einsum("ij,ij->i", normals, half)
    squared = alpha * alpha
    lobe = squared / (np.pi * np.square(aligned * aligned * (squared - 1) + 1))
    # Visibility is G / (4 n·l n·v).
    visibility = 0.5 / np.maximum(
        cosine * np.sqrt(facing * facing * (1 - squared) + squared)
        + facing * np.sqrt(cosine * cosine * (1 - squared) + squared),
        1e-6,
    )
    gloss = np.pi * schlick(f0, np.asarray(half @ toward)) * lobe * visibility * cosine
    base = (1 - schlick(f0, cosine)) * (1 - schlick(f0, facing)) * cosine
    return np.asarray(np.where(f0 > 0, gloss, 0), np.float32), np.asarray(base, np.float32)


def schlick(f0: Values, cosine: NDArray) -> Values:
    """Fresnel reflectance (count,) at these cosines; a surface of f0 = 0 reflects at no angle."""
    rise = (1 - np.clip(cosine, 0, 1)) ** 5
    return np.asarray(np.where(f0 > 0, f0 + (1 - f0) * rise, 0), np.float32)
