"""The tone curve from scene-referred light to sRGB pictures, and its inverse.

The curve is linear up to 0.8, the value that auto exposure gives a white ball facing the camera (see `light.exposure`).
Above, a hyperbola continues it with the same slope and approaches 1, so that highlights keep their gradation instead of
being clipped. Each channel is mapped by itself: a colored highlight becomes whiter as it becomes brighter, as on film.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.color import WIDE_TABLES, linear_from_uint8, srgb_encode
from relit_camera.base.images.image_types import DisplayImage, LinearImage, check_image

SHOULDER = 0.8
"""Up to this value the curve is the identity."""

_MAX_LIGHT = 16.0
"""Brighter light reads 255."""

_MAX_RECOVERABLE = 2.0
"""Brightest light that `inverse_tone_curve` assumes. White in a live frame may be any light from here up; assumed to be
as bright as the sun, it would stay white however far the picture is dimmed."""

_STEPS = 8191
"""Steps of the table, even in √light since sRGB is steep near black. Each code is at least 5 steps wide."""


_STRIPE_VALUES = 1 << 16
"""Numbers processed at a time, so that the intermediate values stay in the processor's cache."""


def tone_curve(linear: ArrayLike) -> NDArray[np.float32]:
    """Display light in 0..1 for scene light of any shape, float32: x up to 0.8, above it 1 - 0.04 / (x - 0.6).

    Negative light is 0. Value and slope are continuous; 1 reads 0.9, 2 reads 0.971, infinity 1.
    """
    light = np.maximum(np.asarray(linear, dtype=np.float32), 0)
    span = 1 - SHOULDER
    above = 1 - span**2 / (np.maximum(light, SHOULDER) - SHOULDER + span)
    return np.where(light <= SHOULDER, light, above).astype(np.float32)


def inverse_tone_curve(display: ArrayLike) -> NDArray[np.float32]:
    """Scene light, float32, that `tone_curve` maps to these values in 0..1; 2 for values from 0.971 up."""
    shown = np.clip(np.asarray(display, dtype=np.float32), 0, tone_curve(_MAX_RECOVERABLE))
    span = 1 - SHOULDER
    above = span**2 / (1 - np.maximum(shown, SHOULDER)) + SHOULDER - span
    return np.where(shown <= SHOULDER, shown, above).astype(np.float32)


def display_from_linear(linear: LinearImage) -> DisplayImage:
    """Map scene light to an sRGB picture, uint8 of the same shape; negative light and NaN become black.

    Raises:
        ImageError: `linear` is not (height, width, 3) float32.
    """
    check_image(linear, np.float32, "linear picture")
    table = _table()
    shown = np.empty(linear.shape, dtype=np.uint8)
    rows = max(_STRIPE_VALUES // max(linear[0].size, 1), 1)
    for top in range(0, len(linear), rows):
        # In C's order, since OpenCV writes to no other. Roots of negative light are NaN, of which it makes 0.
        root = np.minimum(linear[top : top + rows], _MAX_LIGHT, order="C")
        cv2.sqrt(root, dst=root)
        index = cv2.multiply(root, _STEPS / _MAX_LIGHT**0.5, dtype=cv2.CV_16U)
        if WIDE_TABLES:
            cv2.LUT(index, table, dst=shown[top : top + rows])
        else:
            np.take(table, index, out=shown[top : top + rows], mode="clip")  # other modes would make a copy of `out`
    return shown


def linear_from_display(display: DisplayImage) -> LinearImage:
    """Scene light, float32 of the same shape, that `display_from_linear` maps to this sRGB picture.

    Codes from 252 up come back as 2, which shows as 252.
    """
    light: LinearImage = cv2.LUT(display, _inverse_table())
    return light


@lru_cache(maxsize=1)
def _table() -> NDArray[np.uint8]:
    light = np.linspace(0, _MAX_LIGHT**0.5, _STEPS + 1) ** 2
    light = np.pad(light, (0, (1 << 16) - len(light)), mode="edge")  # as long as OpenCV wants it
    return np.round(srgb_encode(tone_curve(light)) * 255).astype(np.uint8)


@lru_cache(maxsize=1)
def _inverse_table() -> NDArray[np.float32]:
    return inverse_tone_curve(linear_from_uint8(np.arange(256, dtype=np.uint8)))
