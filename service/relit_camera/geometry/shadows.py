"""Horizons corrected by the shadows that the pictures show."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.geometry.horizon import Horizon
from relit_camera.space.directions import bearing_from_direction

Floats = NDArray[np.float32]

IN_SHADOW, IN_LIGHT = 0.4, 0.6
"""Share of the predicted light below which a pixel is in shadow, and above which it is lit; between them it may be
either: a half-shadow, or a normal that is somewhat wrong."""
NEAREST_SHADOW = np.radians(10.0)
"""A shadow begins at the horizon. What is dark under a light that stands farther above it is dark for another reason: a
wrong normal, say. Taken for shadow it would hide all the light from behind that no capture has."""
SAFETY = np.radians(2.0)
"""So far a corrected horizon is moved past the light that contradicted it."""
BEARING_WIDTH = np.radians(25.0)
"""Standard deviation of a light's say over neighbouring bearings."""
NEIGHBOURS_PX = 1.0
"""Standard deviation of its say over neighbouring pixels."""
DOUBT = 0.1
"""Weight of the horizon as it was, where one contradicting light, at its own bearing and pixel, weighs 1."""
ROUNDS = 8
BLOCK = 1 << 14
"""Pixels looked at together."""


def calibrated(horizon: Horizon, lit: NDArray[np.float16], directions: NDArray[np.float64]) -> Horizon:
    """The horizon moved as little as makes it agree with what was lit and what was in shadow.

    A light that was seen though it stands below the horizon pulls it down, one that was not seen though it stands just
    above pulls it up, each over neighbouring bearings and pixels.

    Args:
        horizon: by the depth.
        lit: (lights, height, width) as `photometric_stereo.Shading.lit`, NaN unknown.
        directions: (lights, 3) unit vectors.
    """
    height, width, sectors = horizon.heights.shape
    say = _say(directions, sectors)
    seen = lit.reshape(len(lit), -1)
    pixels = np.arange(height * width)
    heights = horizon.heights
    for _ in range(ROUNDS):
        asked = np.zeros((height * width, sectors), np.float32)
        weight = np.zeros((height * width, sectors), np.float32)
        for start in range(0, len(pixels), BLOCK):
            block = pixels[start : start + BLOCK]
            move = _contradictions(Horizon(heights).margins(directions, block), seen[:, block].T)
            asked[block] = move @ say
            weight[block] = (move != 0).astype(np.float32) @ say
        # Where nothing within reach was contradicted in one round, nothing will be in the next.
        pixels = np.flatnonzero(cv2.dilate(weight.max(axis=1).reshape(height, width), np.ones((5, 5))))
        moved = heights + _spread(asked, (height, width)) / (_spread(weight, (height, width)) + DOUBT)
        heights = np.clip(moved, -np.pi / 2, np.pi / 2).astype(np.float16)
    return Horizon(heights)


def _contradictions(margins: Floats, seen: NDArray[np.float16]) -> Floats:
    """How far each light (pixels, lights) asks the horizon to move, up positive; 0 where it agrees or is unknown."""
    wrongly_dark = (seen > IN_LIGHT) & (margins < 0)
    wrongly_lit = (seen < IN_SHADOW) & (margins > 0) & (margins < NEAREST_SHADOW)
    return np.asarray((margins - SAFETY) * wrongly_dark + (margins + SAFETY) * wrongly_lit, np.float32)


def _say(directions: NDArray[np.float64], sectors: int) -> Floats:
    """Weight (lights, sectors) of each light for each bearing."""
    bearing = bearing_from_direction(directions)[0]
    apart = np.cos(bearing[:, None] - 2 * np.pi * np.arange(sectors) / sectors)
    return np.asarray(np.exp((apart - 1) / BEARING_WIDTH**2), np.float32)


def _spread(values: Floats, size: tuple[int, int]) -> Floats:
    """Values (pixels, sectors) blurred over the picture: (height, width, sectors)."""
    planes = values.reshape(*size, -1)
    return np.dstack([cv2.GaussianBlur(plane, (0, 0), NEIGHBOURS_PX) for plane in np.moveaxis(planes, 2, 0)])
