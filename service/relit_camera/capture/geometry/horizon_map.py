"""Horizon maps (Max 1988): which lights the rest of the surface hides from a pixel.

Computed from a depth map, then calibrated by the shadows that the pictures show.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.light.directions import bearing_from_direction


@dataclass(frozen=True)
class HorizonTunables:
    """Constants of the horizons and their calibration, chosen by `relit evaluate olat` (docs/reflectance.md, Shape).

    Attributes:
        sectors: bearings at which a horizon is kept.
        first_step_px: nearest neighbours that count; what nearer ones hide is better given by the normal.
        step_growth: growth of each step of the march, by which distant surface hides light only where it is large.
        outside_px: depth outside the person, far behind every surface.
        in_shadow: fraction of the predicted light below which a pixel counts as in shadow. Between this and `in_light`
            it may be either: a penumbra, or a normal that is somewhat wrong.
        in_light: fraction of the predicted light above which a pixel counts as lit.
        max_shadow_margin_rad: highest margin above the horizon at which darkness is taken for a shadow. Dark pixels
            under higher lights have another cause, such as a wrong normal; taken for shadow they would hide all light
            from behind, which no capture has.
        clearance_rad: how far a corrected horizon is moved past the light that contradicted it.
        bearing_width_rad: standard deviation of a light's weight over neighbouring bearings.
        neighbor_blur_px: standard deviation of its weight over neighbouring pixels.
        prior_weight: of the horizon as it was, where one contradicting light at its own bearing and pixel has 1.
        rounds: of calibration.
    """

    sectors: int = 32
    first_step_px: float = 2.0
    step_growth: float = 0.05
    outside_px: float = -1e4
    in_shadow: float = 0.4
    in_light: float = 0.6
    max_shadow_margin_rad: float = np.radians(10.0)
    clearance_rad: float = np.radians(2.0)
    bearing_width_rad: float = np.radians(25.0)
    neighbor_blur_px: float = 1.0
    prior_weight: float = 0.1
    rounds: int = 8


TUNABLES = HorizonTunables()
BLOCK = 1 << 14
"""Pixels calibrated at a time."""


@dataclass(frozen=True)
class HorizonMap:
    """Horizon of each pixel: the height above the picture plane from which light of a bearing reaches it.

    Attributes:
        heights: (height, width, sectors) float16 radians, -π/2 to π/2, toward the camera positive; sector k has bearing
            2π k / sectors, counter-clockwise from the picture's right, and between sectors heights are interpolated.
    """

    heights: NDArray[np.float16]

    def margins(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        """Height in radians (some, count) of lights (count, 3) above the horizon of row-major pixels (some,)."""
        sectors = self.heights.shape[2]
        height = bearing_from_direction(directions)[1].astype(np.float32)
        return height - self.heights.reshape(-1, sectors)[pixels].astype(np.float32) @ sector_weights(
            directions, sectors
        )


def sector_weights(directions: NDArray[np.float64], sectors: int) -> Float32Array:
    """Matrix (sectors, count) that interpolates values of sectors at the bearings of unit vectors (count, 3)."""
    position = bearing_from_direction(directions)[0] / (2 * np.pi) * sectors
    lower = np.floor(position).astype(int)
    weights = np.zeros((sectors, len(directions)), np.float32)
    column = np.arange(len(directions))
    weights[lower % sectors, column] = 1 - (position - lower)
    weights[(lower + 1) % sectors, column] = position - lower
    return weights


def compute_horizon_map(depth: Float32Array, sectors: int = TUNABLES.sectors) -> HorizonMap:
    """The horizons of a depth map (height, width) in pixels, toward the camera, NaN outside the person.

    The surface counts as solid all the way back. Each bearing is searched in steps that grow with the distance.
    """
    height, width = depth.shape
    solid = np.where(np.isnan(depth), np.float32(TUNABLES.outside_px), depth).astype(np.float32)
    steps = [TUNABLES.first_step_px]
    while steps[-1] < np.hypot(height, width):
        steps.append(steps[-1] + max(1.0, TUNABLES.step_growth * steps[-1]))
    heights = np.empty((height, width, sectors), np.float16)
    for sector in range(sectors):
        bearing = 2 * np.pi * sector / sectors
        steepest = np.full((height, width), -np.inf, np.float32)
        for step in steps:
            shift = np.array([[1, 0, step * np.cos(bearing)], [0, 1, -step * np.sin(bearing)]])
            flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
            there = cv2.warpAffine(solid, shift, (width, height), flags=flags, borderValue=TUNABLES.outside_px)
            np.maximum(steepest, (there - solid) / np.float32(step), out=steepest)
        heights[..., sector] = np.arctan(steepest)
    return HorizonMap(heights)


def calibrate_horizon_map(horizon: HorizonMap, lit: NDArray[np.float16], directions: NDArray[np.float64]) -> HorizonMap:
    """The horizons moved as little as makes them agree with observed light and shadow.

    A light that reached a pixel from below its horizon lowers the horizon; one that did not, from just above it, raises
    it. Both spread over neighbouring bearings and pixels.

    Args:
        horizon: computed from the depth.
        lit: (lights, height, width) as `PhotometricStereoResult.lit`, NaN unknown.
        directions: (lights, 3) unit vectors.
    """
    height, width, sectors = horizon.heights.shape
    bearing_weights = _bearing_weights(directions, sectors)
    observed = lit.reshape(len(lit), -1)
    pixels = np.arange(height * width)
    heights = horizon.heights
    for _ in range(TUNABLES.rounds):
        shift = np.zeros((height * width, sectors), np.float32)
        weight = np.zeros((height * width, sectors), np.float32)
        for start in range(0, len(pixels), BLOCK):
            block = pixels[start : start + BLOCK]
            move = _contradictions(HorizonMap(heights).margins(directions, block), observed[:, block].T)
            shift[block] = move @ bearing_weights
            weight[block] = (move != 0).astype(np.float32) @ bearing_weights
        # Pixels with no contradiction within reach in one round have none in the next.
        pixels = np.flatnonzero(cv2.dilate(weight.max(axis=1).reshape(height, width), np.ones((5, 5))))
        moved = heights + _spread(shift, (height, width)) / (_spread(weight, (height, width)) + TUNABLES.prior_weight)
        heights = np.clip(moved, -np.pi / 2, np.pi / 2).astype(np.float16)
    return HorizonMap(heights)


def _contradictions(margins: Float32Array, observed: NDArray[np.float16]) -> Float32Array:
    """Move of the horizon in radians that each light (pixels, lights) requires, up positive; 0 for none or unknown."""
    wrongly_dark = (observed > TUNABLES.in_light) & (margins < 0)
    wrongly_lit = (observed < TUNABLES.in_shadow) & (margins > 0) & (margins < TUNABLES.max_shadow_margin_rad)
    return np.asarray(
        (margins - TUNABLES.clearance_rad) * wrongly_dark + (margins + TUNABLES.clearance_rad) * wrongly_lit, np.float32
    )


def _bearing_weights(directions: NDArray[np.float64], sectors: int) -> Float32Array:
    """Weight (lights, sectors) of each light for the horizon at each bearing."""
    bearing = bearing_from_direction(directions)[0]
    alignment = np.cos(bearing[:, None] - 2 * np.pi * np.arange(sectors) / sectors)
    return np.asarray(np.exp((alignment - 1) / TUNABLES.bearing_width_rad**2), np.float32)


def _spread(values: Float32Array, size: tuple[int, int]) -> Float32Array:
    """Values (pixels, sectors) blurred over the picture: (height, width, sectors)."""
    planes = values.reshape(*size, -1)
    return np.dstack(
        [cv2.GaussianBlur(plane, (0, 0), TUNABLES.neighbor_blur_px) for plane in np.moveaxis(planes, 2, 0)]
    )
