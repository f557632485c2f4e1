"""What each picture of a set would be if the law of appearance held: a robust fit, pixel by pixel, to all of them.

The law is the reflectance model's without its shadows: pictures that are not yet aligned do not tell a shape by which
shadows could be foretold. What does not fit, shadows and whatever one picture alone shows, counts little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.geometry.photometric_stereo import photometric_stereo
from relit_camera.reflectance.appearance import appearance_terms, fit_appearance, half_directions
from relit_camera.space.colour import luminance

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
