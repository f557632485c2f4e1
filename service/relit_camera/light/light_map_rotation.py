"""Rotating a light map, as a turned head or a turned environment sees it."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.rotations import Rotation
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, direction_from_spherical
from relit_camera.light.light_map import LightMap, total
from relit_camera.light.light_map_interpolation import pad_poles, padded_positions

_SUBSAMPLES = 6
"""Samples per texel in φ, and in θ at the equator: a rotated one-texel lamp keeps its energy within 0.6 %."""
_SMALL_ANGLE = np.radians(1.0)
"""Below this angle a rotation is blended with the unrotated map, so that small rotations approach the
identity without a jump; the light then lags by a quarter of this angle at most."""


@lru_cache(maxsize=1)
def _rotation_samples() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Directions (3, count · 64) that sample the texels, and the weights (32, count) that average them.

    Strips even in φ, weighed by solid angle; fewer samples along θ where texels are narrow; every other strip is
    shifted by half a step, so that samples do not line up with the texels that they sample.
    """
    angles, weights = [], []
    for row in range(MAP_HEIGHT):
        polar = row in (0, MAP_HEIGHT - 1)
        strips = _SUBSAMPLES + (2 if polar else 0)
        edges = np.pi * (0.5 - (row + np.arange(strips + 1) / strips) / MAP_HEIGHT)
        share = -np.diff(np.sin(edges))
        share /= share.sum()
        columns = int(np.ceil(_SUBSAMPLES * np.cos(edges[[0, -1]].mean())))
        for strip in range(strips):
            for column in range(columns):
                offset = (column + 0.25 + 0.5 * (strip % 2)) / columns
                azimuth = 2 * np.pi * ((np.arange(MAP_WIDTH) + offset) / MAP_WIDTH - 0.5)
                angles.append((azimuth, np.full(MAP_WIDTH, edges[strip : strip + 2].mean())))
                weight = np.zeros(MAP_HEIGHT, np.float32)
                weight[row] = share[strip] / columns
                weights.append(weight)
    azimuths, elevations = np.array(angles).transpose(1, 0, 2)
    directions = direction_from_spherical(azimuths, elevations).reshape(-1, 3)
    return np.ascontiguousarray(directions.T, dtype=np.float32), np.ascontiguousarray(np.transpose(weights))


def rotate_light_map(light_map: LightMap, rotation: Rotation) -> LightMap:
    """The light map in a rotated frame: E_out(l) = E_in(R·l); radiance stays non-negative.

    For a head rotated by R (head-frame vectors to world-frame vectors) this is the light in the head's frame. Every
    texel averages samples of the energy-conserving interpolation (`light.light_map_interpolation`), so a constant map
    stays constant, a lamp keeps its energy within 1 % in any direction, and the whole map keeps it exactly in each
    channel. The identity returns a copy of the input.
    """
    angle = float(rotation.magnitude())
    if angle == 0.0:
        return light_map.copy()
    directions, weights = _rotation_samples()
    row, column = padded_positions(*(rotation.as_matrix().astype(np.float32) @ directions))
    shape = (weights.shape[1], MAP_WIDTH)
    sampled = cv2.remap(pad_poles(light_map), column.reshape(shape), row.reshape(shape), cv2.INTER_LINEAR)
    rotated: LightMap = (weights @ sampled.reshape(shape[0], -1)).reshape(light_map.shape)
    if angle < _SMALL_ANGLE:
        rotated = light_map + np.float32(angle / _SMALL_ANGLE) * (rotated - light_map)
    before, after = total(light_map), total(rotated)
    rotated *= np.divide(before, after, out=np.ones(3), where=after > 0).astype(np.float32)
    return rotated
