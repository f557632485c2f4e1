"""What each picture of a set would be if the law of appearance held: a robust fit, pixel by pixel, to all of them.

The law is the reflectance model's without its shadows: pictures that are not yet aligned do not tell a shape by which
shadows could be foretold. What does not fit, shadows and whatever one picture alone shows, counts little.

Pictures of a set that no light could make: black ones, torn or noisy ones, pictures of something else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.geometry.photometric_stereo import photometric_stereo
from relit_camera.capture.reflectance.appearance_model import appearance_terms, fit_appearance, half_directions

_OPEN = 10.0
"""A margin over the horizon with which nothing is hidden."""
_BLOCK = 1 << 12
"""Pixels fitted at a time."""


def predict_pictures(
    pictures: NDArray[np.float32], directions: NDArray[np.float64], matte: NDArray[np.float32]
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
    toward, half = (each.astype(np.float32) for each in (directions, half_directions(directions)))
    bright = float(np.percentile(values[:, inside[:: max(1, len(inside) // 4096)]], 99))
    predicted = np.zeros((lights, height * width), np.float32)
    for start in range(0, len(inside), _BLOCK):
        block = inside[start : start + _BLOCK]
        cosines = normals[block] @ toward.T
        terms = appearance_terms(cosines, normals[block] @ half.T, np.full_like(cosines, _OPEN), toward[:, 2])
        amounts, _ = fit_appearance(terms, np.ascontiguousarray(values[:, block].T)[:, None], bright)
        predicted[:, block] = (amounts @ terms)[:, 0].T
    return predicted.reshape(lights, height, width)


Floats = NDArray[np.float32]

_JUDGED = -0.2
"""Z of the light from which a prediction is good enough to judge by: light from behind reaches rims alone."""
_BLACK, _EXPECTED = 0.1, 0.3
"""Share of the predicted light below which a picture is black, where that is this share of the median."""
_ROUGH = 4.0
"""Times the median roughness."""
_LEAST_LIKENESS = 0.5
_FROM_THE_FRONT = 0.0
"""Z from which a picture's features must be those predicted."""


def find_outlier_pictures(
    light: Floats, predicted: Floats, directions: NDArray[np.float64], matte: Mask
) -> dict[int, str]:
    """Index of each picture that does not belong to the set, and the reason to give.

    Args:
        light: (lights, height, width) luminance as captured.
        predicted: (lights, height, width) luminance that a model fitted to all of them has.
        directions: (lights, 3) unit vectors toward the lights.
        matte: (height, width).
    """
    inside = matte > 0.5
    seen, expected = light[:, inside].mean(axis=1), predicted[:, inside].mean(axis=1)
    share = seen / np.maximum(expected, 1e-9)
    black = (share < _BLACK) & (expected > _EXPECTED * np.median(expected))
    roughness = _roughness(light) / np.maximum(seen, 1e-3 * float(light.max()) + 1e-9)
    times = roughness / max(float(np.median(roughness)), 1e-9)
    correlation = masked_correlation(light, predicted, matte)
    unlike = (correlation < _LEAST_LIKENESS) & (directions[:, 2] > _FROM_THE_FRONT)
    reasons = {}
    for index in np.flatnonzero(directions[:, 2] > _JUDGED).tolist():
        if black[index]:
            reasons[index] = f"black: {share[index]:.0%} of the light expected"
        elif times[index] > _ROUGH:
            reasons[index] = f"torn or noisy: {times[index]:.0f} times as rough as the others"
        elif unlike[index]:
            reasons[index] = f"unlike the others: correlation {correlation[index]:.2f} with what they predict"
    return reasons


def masked_correlation(light: Floats, predicted: Floats, matte: Mask) -> NDArray[np.float64]:
    """Correlation (lights,) of luminances (lights, height, width) inside a matte; 0 of a flat one."""
    one, other = (pictures[:, matte > 0.5].astype(np.float64) for pictures in (light, predicted))
    one, other = one - one.mean(axis=1, keepdims=True), other - other.mean(axis=1, keepdims=True)
    energy = np.sqrt(np.square(one).sum(axis=1) * np.square(other).sum(axis=1))
    return np.asarray((one * other).sum(axis=1) / np.maximum(energy, 1e-12))


def _roughness(light: Floats) -> NDArray[np.float64]:
    """Mean curvature (lights,) from pixel to pixel, down or across, whichever is more: torn fields show down."""
    down, across = (np.abs(np.diff(light, 2, axis=axis)).mean(axis=(1, 2)) for axis in (1, 2))
    return np.asarray(np.maximum(down, across), np.float64)
