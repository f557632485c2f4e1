"""The display curve: scene-referred light to sRGB pictures, and back.

The curve is linear up to 0.8, where a white ball facing the camera is put (see `light.exposure`). Above, a hyperbola
leaves that line with the same slope and approaches 1: highlights keep their gradation instead of being cut. It works on
each channel alone, so a coloured highlight turns whiter as it grows brighter, as film and eye have it.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.color import linear_from_uint8, srgb_encode
from relit_camera.base.images.image_types import DisplayImage, LinearImage, check_image

SHOULDER = 0.8
"""Display light below this is the scene's own."""

_MAX_LIGHT = 16.0
"""Brighter light reads 255."""

_MAX_RECOVERABLE = 2.0
"""Brightest light that a picture is taken to hold. White in a live frame may be any light from here up; taken for the
sun, it would stay white however far the picture is dimmed."""

_STEPS = 8191
"""Steps of the table over √light up to the peak; √ since sRGB is steep near black. A code is at least 5 steps wide."""


_STRIPE_ROWS = 32
"""Rows done at a time: the intermediate values stay in the processor's cache, and no large memory is taken."""


def tone_curve(linear: ArrayLike) -> NDArray[np.float32]:
    """Display light in 0..1 of scene light of any shape, float32: x up to 0.8, above 1 - 0.04 / (x - 0.6).

    Negative light is 0. Value and slope are continuous; 1 reads 0.9, 2 reads 0.971, infinity 1.
    """
    light = np.maximum(np.asarray(linear, dtype=np.float32), 0)
    span = 1 - SHOULDER
    above = 1 - span**2 / (np.maximum(light, SHOULDER) - SHOULDER + span)
    return np.where(light <= SHOULDER, light, above).astype(np.float32)


def inverse_tone_curve(display: ArrayLike) -> NDArray[np.float32]:
    """Scene light, float32, that `tone_curve` shows as these values in 0..1; 2 from 0.971 up."""
    shown = np.clip(np.asarray(display, dtype=np.float32), 0, tone_curve(_MAX_RECOVERABLE))
    span = 1 - SHOULDER
    above = span**2 / (1 - np.maximum(shown, SHOULDER)) + SHOULDER - span
    return np.where(shown <= SHOULDER, shown, above).astype(np.float32)


def display_from_linear(linear: LinearImage) -> DisplayImage:
    """SRGB picture, uint8 of the same shape, of scene light; negative light and NaN are black.

    Raises:
        ImageError: `linear` is not (height, width, 3) float32.
    """
    check_image(linear, np.float32, "linear picture")
    table = _table()
    shown = np.empty(linear.shape, dtype=np.uint8)
    for top in range(0, len(linear), _STRIPE_ROWS):
        root = np.clip(linear[top : top + _STRIPE_ROWS], 0, _MAX_LIGHT, order="C")  # OpenCV writes to no other order
        cv2.sqrt(root, dst=root)
        index = cv2.multiply(root, _STEPS / _MAX_LIGHT**0.5, dtype=cv2.CV_16U)
        np.take(
            table, index, out=shown[top : top + _STRIPE_ROWS], mode="clip"
        )  # other modes would make a copy of `out`
    return shown


def linear_from_display(display: DisplayImage) -> LinearImage:
    """Scene light, float32 of the same shape, that `display_from_linear` shows as this sRGB picture.

    Codes from 252 up come back as 2, which shows as 252.
    """
    light: LinearImage = cv2.LUT(display, _inverse_table())
    return light


@lru_cache(maxsize=1)
def _table() -> NDArray[np.uint8]:
    light = np.linspace(0, _MAX_LIGHT**0.5, _STEPS + 1) ** 2
    return np.round(srgb_encode(tone_curve(light)) * 255).astype(np.uint8)


@lru_cache(maxsize=1)
def _inverse_table() -> NDArray[np.float32]:
    return inverse_tone_curve(linear_from_uint8(np.arange(256, dtype=np.uint8)))
