"""Pictures of a set that no light could make: black ones, torn or noisy ones, pictures of something else."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.space.images import Mask

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


def unfit_pictures(light: Floats, predicted: Floats, directions: NDArray[np.float64], matte: Mask) -> dict[int, str]:
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
    likeness = likeness_of(light, predicted, matte)
    unlike = (likeness < _LEAST_LIKENESS) & (directions[:, 2] > _FROM_THE_FRONT)
    reasons = {}
    for index in np.flatnonzero(directions[:, 2] > _JUDGED).tolist():
        if black[index]:
            reasons[index] = f"black: {share[index]:.0%} of the light expected"
        elif times[index] > _ROUGH:
            reasons[index] = f"torn or noisy: {times[index]:.0f} times as rough as the others"
        elif unlike[index]:
            reasons[index] = f"unlike the others: correlation {likeness[index]:.2f} with what they predict"
    return reasons


def likeness_of(light: Floats, predicted: Floats, matte: Mask) -> NDArray[np.float64]:
    """Correlation (lights,) of luminances (lights, height, width) inside a matte; 0 of a flat one."""
    one, other = (pictures[:, matte > 0.5].astype(np.float64) for pictures in (light, predicted))
    one, other = one - one.mean(axis=1, keepdims=True), other - other.mean(axis=1, keepdims=True)
    energy = np.sqrt(np.square(one).sum(axis=1) * np.square(other).sum(axis=1))
    return np.asarray((one * other).sum(axis=1) / np.maximum(energy, 1e-12))


def _roughness(light: Floats) -> NDArray[np.float64]:
    """Mean curvature (lights,) from pixel to pixel, down or across, whichever is more: torn fields show down."""
    down, across = (np.abs(np.diff(light, 2, axis=axis)).mean(axis=(1, 2)) for axis in (1, 2))
    return np.asarray(np.maximum(down, across), np.float64)
