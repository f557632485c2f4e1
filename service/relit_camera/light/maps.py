"""Light maps: resampling panoramas, rotation, irradiance."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from relit_camera.errors import ImageError
from relit_camera.light.sphere import extend, positions
from relit_camera.space.directions import (
    MAP_HEIGHT,
    MAP_WIDTH,
    direction_from_spherical,
    texel_directions,
    texel_solid_angles,
)
from relit_camera.space.images import check_image

LightMap = NDArray[np.float32]
"""(32, 64, 3) float32 linear RGB radiance, row 0 up, the middle toward the camera (see `space.directions`)."""

_SUBSAMPLES = 6
"""Samples a texel in φ, and in θ at the equator: a rotated one-texel lamp keeps its energy within 0.6 %."""
_SMALL_ANGLE = np.radians(1.0)
"""Below this angle a rotation is blended with the unrotated map, so that it ends in the identity without a jump; light
then lags by at most a quarter of it."""


def check_light_map(light_map: NDArray, name: str = "light map") -> None:
    """Check shape (32, 64, 3) and float32.

    Raises:
        ImageError: it is neither; the message has the shape.
    """
    check_image(light_map, np.float32, name)
    if light_map.shape != (MAP_HEIGHT, MAP_WIDTH, 3):
        raise ImageError(f"{name} has shape {light_map.shape}, not ({MAP_HEIGHT}, {MAP_WIDTH}, 3)")


def _overlaps(edges_in: NDArray[np.float64], edges_out: NDArray[np.float64]) -> NDArray[np.float32]:
    """Weights (out, in) of cells between rising edges: the share of each output cell that an input cell covers."""
    top = np.minimum(edges_out[1:, None], edges_in[None, 1:])
    bottom = np.maximum(edges_out[:-1, None], edges_in[None, :-1])
    return np.asarray(np.maximum(top - bottom, 0) / np.diff(edges_out)[:, None], np.float32)


def resample_by_area(radiance: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """A spherical map (height, width, 3) of one of any size (h, w, 3), both covering the whole sphere.

    Each texel is the mean over its solid angle, texels of the input taken as flat: Σ E·ω is kept to rounding. Solid
    angle is the product of widths in θ and in sin φ, so rows and columns are weighed one after the other.
    """
    rows_in, columns_in = radiance.shape[:2]
    rows = _overlaps(*(-np.cos(np.linspace(0, np.pi, n + 1)) for n in (rows_in, height)))
    columns = _overlaps(*(np.linspace(0, 1, n + 1) for n in (columns_in, width)))
    shrunk = (rows @ radiance.reshape(rows_in, -1)).reshape(height, columns_in, 3)
    return np.ascontiguousarray(np.matmul(columns, shrunk), dtype=np.float32)


def resample(radiance: NDArray[np.float32]) -> LightMap:
    """The light map of panorama radiance (h, w, 3) in map axes, of any size; Σ E·ω is kept to 1e-5."""
    return resample_by_area(radiance, MAP_HEIGHT, MAP_WIDTH)


@lru_cache(maxsize=1)
def _samples() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Directions (3, count · 64) that sample the texels, and the weights (32, count) which average them.

    Strips even in φ, weighed by solid angle; fewer samples along θ where texels are narrow; every other strip is
    shifted by half a step, which keeps the samples apart from the rows of whatever is sampled.
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


def rotate(light_map: LightMap, rotation: Rotation) -> LightMap:
    """The light map seen from a rotated frame: E_out(l) = E_in(R·l), radiance stays non-negative.

    For a head turned by R in the room (head-frame vectors to room-frame vectors) it is the light in the head's frame.
    Every texel averages samples of the conserving interpolation in `light.sphere`, so a constant map stays constant, a
    lamp keeps its energy within 1 % wherever it stands and goes, and the whole map, per channel, exactly. The identity
    returns the input.
    """
    angle = float(rotation.magnitude())
    if angle == 0.0:
        return light_map.copy()
    directions, weights = _samples()
    row, column = positions(*(rotation.as_matrix().astype(np.float32) @ directions))
    shape = (weights.shape[1], MAP_WIDTH)
    sampled = cv2.remap(extend(light_map), column.reshape(shape), row.reshape(shape), cv2.INTER_LINEAR)
    rotated: LightMap = (weights @ sampled.reshape(shape[0], -1)).reshape(light_map.shape)
    if angle < _SMALL_ANGLE:
        rotated = light_map + np.float32(angle / _SMALL_ANGLE) * (rotated - light_map)
    before, after = total(light_map), total(rotated)
    rotated *= np.divide(before, after, out=np.ones(3), where=after > 0).astype(np.float32)
    return rotated


def total(light_map: LightMap) -> NDArray[np.float64]:
    """Σ E·ω per channel (3,): the energy of the light from all sides."""
    rows: NDArray[np.float64] = light_map.sum(axis=1, dtype=np.float64)
    return texel_solid_angles(*light_map.shape[:2])[:, 0] @ rows


def irradiance(light_map: LightMap, normal: ArrayLike) -> NDArray[np.float32]:
    """Σ E·ω·max(0, n·l) per channel (..., 3) on surfaces with unit normals (..., 3).

    A lamp of irradiance 1 gives a surface that faces it 1, and a white diffuse surface then reads 1.
    """
    cosine = np.maximum(0, np.asarray(normal, np.float64) @ texel_directions().reshape(-1, 3).T)
    weighted = (light_map * texel_solid_angles()[..., None]).reshape(-1, 3)
    return (cosine @ weighted).astype(np.float32)
