"""Which light reaches a pixel past the rest of the surface: horizons of a depth map (Max 1988)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.space.directions import bearing_from_direction

Floats = NDArray[np.float32]

SECTORS = 32
FIRST_STEP_PX = 2.0
"""Nearer neighbours are left out: what they hide, the normal tells better."""
STEP_GROWTH = 0.05
"""Each step of the march is so much longer than the last, and 1 px at least: far away only what is large hides."""
NOTHING_PX = -1e4
"""Depth outside of the person."""


@dataclass(frozen=True)
class Horizon:
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


def horizon_of(depth: Floats, sectors: int = SECTORS) -> Horizon:
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
    return Horizon(heights)
