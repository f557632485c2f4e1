"""What each picture of a set would be if a simple law of shading held: a robust fit, pixel by pixel, to all of them.

A pixel under a light is the sum, no part negative, of diffuse reflection (Lambert), light that wraps around a
scattering surface, two glossy lobes (Blinn 1977) and a constant. What does not fit, shadows and whatever one picture
alone shows, counts little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.geometry.photometric_stereo import photometric_stereo
from relit_camera.space.colour import luminance

Floats = NDArray[np.float32]

_WRAP = 0.5
"""How far beyond the terminator light wraps, as a cosine."""
_GLOSS = (12, 60)
"""Exponents of the lobes."""
_ONSET = 0.1
"""Cosine of the light over which gloss sets in."""
_ROUNDS, _SWEEPS = 4, 40
_RIDGE = 1e-3
_SPREAD, _QUANTUM = 0.1, 0.02
"""Residual that makes an equation count half: as a share of the pixel's bright values, and of the set's."""
_BRIGHT_PERCENTILE = 90.0
_BLOCK = 1 << 12
"""Pixels fitted at a time."""


def predict_pictures(
    pictures: Floats, directions: NDArray[np.float64], matte: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Luminance (lights, height, width) that the model gives each picture; 0 outside of the matte.

    Args:
        pictures: (lights, height, width, 3) linear.
        directions: (lights, 3) unit vectors toward the lights.
        matte: (height, width); pixels where it is 0 are left out.
    """
    lights, height, width, _ = pictures.shape
    inside = np.flatnonzero(matte.ravel() > 0)
    values = luminance(pictures).reshape(lights, -1)
    normals = photometric_stereo(pictures, directions, matte).normals.reshape(-1, 3)
    unit = float(np.percentile(values[:, inside[:: max(1, len(inside) // 4096)]], 99))
    predicted = np.zeros((lights, height * width), np.float32)
    for start in range(0, len(inside), _BLOCK):
        block = inside[start : start + _BLOCK]
        terms = _terms(normals[block], directions.astype(np.float32))
        predicted[:, block] = _fitted(terms, np.ascontiguousarray(values[:, block].T), unit).T
    return predicted.reshape(lights, height, width)


def _terms(normals: Floats, toward: Floats) -> Floats:
    """The model's terms (pixels, lights, terms) for unit normals (pixels, 3) and lights (lights, 3)."""
    cosine = normals @ toward.T
    half = toward + np.array([0, 0, 1], np.float32)  # the camera is at +Z
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-6)
    gloss = np.maximum(normals @ half.T, 0)
    onset = np.clip(cosine / _ONSET, 0, 1)
    wrapped = np.maximum((cosine + _WRAP) / (1 + _WRAP), 0) ** 2
    lobes = [gloss**exponent * onset for exponent in _GLOSS]
    return np.stack([np.maximum(cosine, 0), wrapped, *lobes, np.ones_like(cosine)], axis=-1)


def _fitted(terms: Floats, values: Floats, unit: float) -> Floats:
    """Values (pixels, lights) by the terms, their shares not negative, outliers counting less."""
    bright = np.percentile(values, _BRIGHT_PERCENTILE, axis=1, keepdims=True)
    scale = (_SPREAD * bright + _QUANTUM * unit + 1e-9).astype(np.float32)
    weights = np.ones_like(values)
    for _ in range(_ROUNDS):
        weighted = np.asarray((terms * weights[..., None]).transpose(0, 2, 1), np.float32)
        shares = _not_negative(np.asarray(weighted @ terms), np.einsum("ptl,pl->pt", weighted, values))
        fitted = np.einsum("plt,pt->pl", terms, shares)
        weights = np.asarray(1 / (1 + ((values - fitted) / scale) ** 2), np.float32)
    return np.asarray(fitted, np.float32)


def _not_negative(normal: Floats, right: Floats) -> Floats:
    """Least squares (pixels, terms) without negative values, by cyclic coordinate descent (Franc et al. 2005).

    Args:
        normal: (pixels, terms, terms).
        right: (pixels, terms).
    """
    count = right.shape[1]
    diagonal = np.arange(count)
    normal[:, diagonal, diagonal] += _RIDGE * np.trace(normal, axis1=1, axis2=2)[:, None] / count + 1e-12
    shares = np.zeros_like(right)
    for _ in range(_SWEEPS):
        for term in range(count):
            left = right[:, term] - np.einsum("pt,pt->p", normal[:, term], shares)
            shares[:, term] = np.maximum(shares[:, term] + left / normal[:, term, term], 0)
    return shares
