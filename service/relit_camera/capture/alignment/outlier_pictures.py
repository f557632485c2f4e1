"""Outlier pictures of a one-light set: black ones, torn or noisy ones, and pictures of something else.

Each picture is compared with a prediction of it by the appearance model, fitted robustly, pixel by pixel, to all
pictures of the set. The model is used without horizons: from pictures that are not yet aligned no shape can be found
that would predict shadows. Shadows, and whatever a single picture shows, have little weight in the robust fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.geometry.photometric_stereo import photometric_stereo
from relit_camera.capture.reflectance.appearance_model import appearance_terms, fit_appearance, half_vectors

_UNOCCLUDED_MARGIN = 10.0
"""A margin above the horizon at which nothing hides the light."""
_BLOCK = 1 << 12
"""Pixels fitted at a time."""


@dataclass(frozen=True)
class OutlierTunables:
    """Thresholds for outlier pictures, chosen on the sets of `relit evaluate olat` (docs/reflectance.md).

    Attributes:
        min_light_z: z of the light from which a prediction is good enough to judge by: light from behind lights rims
            alone.
        black_fraction: fraction of the predicted light below which a picture is black, if it should not be dark.
        min_expected_fraction: fraction of the median predicted light from which a picture should not be dark.
        max_roughness_ratio: roughness over the set's median above which a picture is torn or noisy.
        min_correlation: with the prediction; below it a picture shows something else.
        correlation_min_z: z of the light from which the correlation counts.
    """

    min_light_z: float = -0.2
    black_fraction: float = 0.1
    min_expected_fraction: float = 0.3
    max_roughness_ratio: float = 4.0
    min_correlation: float = 0.5
    correlation_min_z: float = 0.0


TUNABLES = OutlierTunables()


def predict_pictures(
    pictures: NDArray[np.float32], directions: NDArray[np.float64], matte: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Luminance (lights, height, width) of each picture as the appearance model predicts it; 0 outside the matte.

    Args:
        pictures: (lights, height, width, 3) linear.
        directions: (lights, 3) unit vectors toward the lights.
        matte: (height, width); pixels where it is 0 are left out.
    """
    lights, height, width, _ = pictures.shape
    inside = np.flatnonzero(matte.ravel() > 0)
    values = luminance(pictures).reshape(lights, -1)
    normals = photometric_stereo(pictures, directions, matte).normals.reshape(-1, 3)
    toward, half = (each.astype(np.float32) for each in (directions, half_vectors(directions)))
    bright = float(np.percentile(values[:, inside[:: max(1, len(inside) // 4096)]], 99))
    predicted = np.zeros((lights, height * width), np.float32)
    for start in range(0, len(inside), _BLOCK):
        block = inside[start : start + _BLOCK]
        cosines = normals[block] @ toward.T
        terms = appearance_terms(
            cosines, normals[block] @ half.T, np.full_like(cosines, _UNOCCLUDED_MARGIN), toward[:, 2]
        )
        amounts, _ = fit_appearance(terms, np.ascontiguousarray(values[:, block].T)[:, None], bright)
        predicted[:, block] = (amounts @ terms)[:, 0].T
    return predicted.reshape(lights, height, width)


def find_outlier_pictures(
    light: Float32Array, predicted: Float32Array, directions: NDArray[np.float64], matte: Mask
) -> dict[int, str]:
    """Index of each picture that does not belong to the set, with the reason as a text for the user.

    Args:
        light: (lights, height, width) luminance as captured.
        predicted: (lights, height, width) luminance predicted by `predict_pictures`.
        directions: (lights, 3) unit vectors toward the lights.
        matte: (height, width).
    """
    inside = matte > 0.5
    observed, expected = light[:, inside].mean(axis=1), predicted[:, inside].mean(axis=1)
    fraction = observed / np.maximum(expected, 1e-9)
    black = (fraction < TUNABLES.black_fraction) & (expected > TUNABLES.min_expected_fraction * np.median(expected))
    roughness = _roughness(light) / np.maximum(observed, 1e-3 * float(light.max()) + 1e-9)
    times = roughness / max(float(np.median(roughness)), 1e-9)
    correlation = masked_correlation(light, predicted, matte)
    uncorrelated = (correlation < TUNABLES.min_correlation) & (directions[:, 2] > TUNABLES.correlation_min_z)
    reasons = {}
    for index in np.flatnonzero(directions[:, 2] > TUNABLES.min_light_z).tolist():
        if black[index]:
            reasons[index] = f"black: {fraction[index]:.0%} of the light expected"
        elif times[index] > TUNABLES.max_roughness_ratio:
            reasons[index] = f"torn or noisy: {times[index]:.0f} times as rough as the others"
        elif uncorrelated[index]:
            reasons[index] = f"unlike the others: correlation {correlation[index]:.2f} with what they predict"
    return reasons


def masked_correlation(light: Float32Array, predicted: Float32Array, matte: Mask) -> NDArray[np.float64]:
    """Correlation (lights,) of luminances (lights, height, width) inside a matte; 0 of a flat one."""
    one, other = (pictures[:, matte > 0.5].astype(np.float64) for pictures in (light, predicted))
    one, other = one - one.mean(axis=1, keepdims=True), other - other.mean(axis=1, keepdims=True)
    energy = np.sqrt(np.square(one).sum(axis=1) * np.square(other).sum(axis=1))
    return np.asarray((one * other).sum(axis=1) / np.maximum(energy, 1e-12))


def _roughness(light: Float32Array) -> NDArray[np.float64]:
    """Mean second difference (lights,) along columns or rows, whichever is larger: torn fields show along columns."""
    down, across = (np.abs(np.diff(light, 2, axis=axis)).mean(axis=(1, 2)) for axis in (1, 2))
    return np.asarray(np.maximum(down, across), np.float64)
