"""Which light reaches a pixel past the rest of the surface: horizons of a depth map (Max 1988).

Horizons corrected by the shadows that the pictures show.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.light.directions import bearing_from_direction

Floats = NDArray[np.float32]

SECTORS = 32
FIRST_STEP_PX = 2.0
"""Nearer neighbours are left out: what they hide, the normal tells better."""
STEP_GROWTH = 0.05
"""Each step of the march is so much longer than the last, and 1 px at least: far away only what is large hides."""
NOTHING_PX = -1e4
"""Depth outside of the person."""


@dataclass(frozen=True)
class HorizonMap:
    """How high over the picture's plane a light must stand, by its bearing in the picture, to reach each pixel.

    Attributes:
        heights: (height, width, sectors) float16 radians, -π/2 to π/2, toward the camera positive; sector k has bearing
            2π k / sectors, counter-clockwise from the picture's right, and between sectors heights are interpolated.
    """

    heights: NDArray[np.float16]

    def margins(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
        """How far lights (count, 3) stand above the horizon of pixels (some,), row-major: (some, count) radians."""
        sectors = self.heights.shape[2]
        height = bearing_from_direction(directions)[1].astype(np.float32)
        return height - self.heights.reshape(-1, sectors)[pixels].astype(np.float32) @ sector_weights(
            directions, sectors
        )


def sector_weights(directions: NDArray[np.float64], sectors: int) -> Floats:
    """Matrix (sectors, count) that interpolates values of sectors at the bearings of unit vectors (count, 3)."""
    place = bearing_from_direction(directions)[0] / (2 * np.pi) * sectors
    lower = np.floor(place).astype(int)
    weights = np.zeros((sectors, len(directions)), np.float32)
    column = np.arange(len(directions))
    weights[lower % sectors, column] = 1 - (place - lower)
    weights[(lower + 1) % sectors, column] = place - lower
    return weights


def compute_horizon_map(depth: Floats, sectors: int = SECTORS) -> HorizonMap:
    """The horizon of a depth map (height, width) in pixels, toward the camera, NaN where there is nothing.

    What is seen counts as solid all the way back. Each bearing is marched along in steps that grow with the distance.
    """
    height, width = depth.shape
    solid = np.where(np.isnan(depth), np.float32(NOTHING_PX), depth).astype(np.float32)
    steps = [FIRST_STEP_PX]
    while steps[-1] < np.hypot(height, width):
        steps.append(steps[-1] + max(1.0, STEP_GROWTH * steps[-1]))
    heights = np.empty((height, width, sectors), np.float16)
    for sector in range(sectors):
        bearing = 2 * np.pi * sector / sectors
        steepest = np.full((height, width), -np.inf, np.float32)
        for step in steps:
            shift = np.array([[1, 0, step * np.cos(bearing)], [0, 1, -step * np.sin(bearing)]])
            flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
            there = cv2.warpAffine(solid, shift, (width, height), flags=flags, borderValue=NOTHING_PX)
            np.maximum(steepest, (there - solid) / np.float32(step), out=steepest)
        heights[..., sector] = np.arctan(steepest)
    return HorizonMap(heights)


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
NEIGHBORS_PX = 1.0
"""Standard deviation of its say over neighbouring pixels."""
DOUBT = 0.1
"""Weight of the horizon as it was, where one contradicting light, at its own bearing and pixel, weighs 1."""
ROUNDS = 8
BLOCK = 1 << 14
"""Pixels looked at together."""


def calibrate_horizon_map(horizon: HorizonMap, lit: NDArray[np.float16], directions: NDArray[np.float64]) -> HorizonMap:
    """The horizon moved as little as makes it agree with what was lit and what was in shadow.

    A light that was seen though it stands below the horizon pulls it down, one that was not seen though it stands just
    above pulls it up, each over neighbouring bearings and pixels.

    Args:
        horizon: by the depth.
        lit: (lights, height, width) as `photometric_stereo.Shading.lit`, NaN unknown.
        directions: (lights, 3) unit vectors.
    """
    height, width, sectors = horizon.heights.shape
    say = _bearing_weights(directions, sectors)
    seen = lit.reshape(len(lit), -1)
    pixels = np.arange(height * width)
    heights = horizon.heights
    for _ in range(ROUNDS):
        asked = np.zeros((height * width, sectors), np.float32)
        weight = np.zeros((height * width, sectors), np.float32)
        for start in range(0, len(pixels), BLOCK):
            block = pixels[start : start + BLOCK]
            move = _contradictions(HorizonMap(heights).margins(directions, block), seen[:, block].T)
            asked[block] = move @ say
            weight[block] = (move != 0).astype(np.float32) @ say
        # Where nothing within reach was contradicted in one round, nothing will be in the next.
        pixels = np.flatnonzero(cv2.dilate(weight.max(axis=1).reshape(height, width), np.ones((5, 5))))
        moved = heights + _spread(asked, (height, width)) / (_spread(weight, (height, width)) + DOUBT)
        heights = np.clip(moved, -np.pi / 2, np.pi / 2).astype(np.float16)
    return HorizonMap(heights)


def _contradictions(margins: Floats, seen: NDArray[np.float16]) -> Floats:
    """How far each light (pixels, lights) asks the horizon to move, up positive; 0 where it agrees or is unknown."""
    wrongly_dark = (seen > IN_LIGHT) & (margins < 0)
    wrongly_lit = (seen < IN_SHADOW) & (margins > 0) & (margins < NEAREST_SHADOW)
    return np.asarray((margins - SAFETY) * wrongly_dark + (margins + SAFETY) * wrongly_lit, np.float32)


def _bearing_weights(directions: NDArray[np.float64], sectors: int) -> Floats:
    """Weight (lights, sectors) of each light for each bearing."""
    bearing = bearing_from_direction(directions)[0]
    apart = np.cos(bearing[:, None] - 2 * np.pi * np.arange(sectors) / sectors)
    return np.asarray(np.exp((apart - 1) / BEARING_WIDTH**2), np.float32)


def _spread(values: Floats, size: tuple[int, int]) -> Floats:
    """Values (pixels, sectors) blurred over the picture: (height, width, sectors)."""
    planes = values.reshape(*size, -1)
    return np.dstack([cv2.GaussianBlur(plane, (0, 0), NEIGHBORS_PX) for plane in np.moveaxis(planes, 2, 0)])
