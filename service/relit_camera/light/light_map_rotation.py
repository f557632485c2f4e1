"""Interpolation on the light map that conserves energy, poles included.

Bilinear interpolation in (θ, φ) gives a lamp in row 0 8 % too much energy, since its weight is not spread by solid
angle. Linear interpolation in sin φ between knots y_i = sin φ_i / cos(Δφ/2) is exact: the weight function of texel i
integrates to (y_{i-1} − y_{i+1}) / 2 · Δθ, and sin φ_{i-1} − sin φ_{i+1} = 2 sin Δφ cos φ_i is 2 cos(Δφ/2) times
sin φ_top − sin φ_bottom, so the integral is the texel's solid angle. The first and last knot fall on the poles.

Polar texels are narrow in θ: a row is blurred along θ until every texel is about as wide as one at the equator. Both
steps are linear, keep a constant map constant and keep each texel's energy, and `splat` is the exact adjoint of
interpolating an extended map at `padded_positions`.

Light maps: resampling panoramas, rotation, irradiance.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from relit_camera.base.errors import ImageError
from relit_camera.base.images.image_types import check_image
from relit_camera.light.directions import (
    MAP_HEIGHT,
    MAP_WIDTH,
    direction_from_spherical,
    texel_directions,
    texel_solid_angles,
)

Floats32 = NDArray[np.float32]

POLE_PADDED_ROWS = MAP_HEIGHT + 2
"""Rows of an extended map: each pole's row becomes two, its mean at the pole and a mixture with the next near it."""
_POLE_MIX = 0.4
"""Share of the next row in that mixture, and its place in sin φ on the way there: it is where a lamp in row 0, or one
splatted near the pole, is displaced least (within a degree). Any share conserves energy."""
_POLES = ((0, 1, 0, 1), (-1, -2, -1, -2))
"""Of both poles: extended rows at and near the pole, map rows at and next to it."""


@lru_cache(maxsize=1)
def _knots() -> NDArray[np.float64]:
    elevation = np.pi * (0.5 - (np.arange(MAP_HEIGHT) + 0.5) / MAP_HEIGHT)
    rows = np.sin(elevation) / np.cos(np.pi / (2 * MAP_HEIGHT))
    near = 1 - _POLE_MIX * (1 - rows[1])
    return np.concatenate([[1.0, near], rows[1:-1], [-near, -1.0]])


@lru_cache(maxsize=1)
def _theta_blur() -> Floats32:
    """Circulant matrices (32, 64, 64), one a row: symmetric, doubly stochastic, the identity near the equator."""
    height = np.pi / MAP_HEIGHT
    colatitude = height * (np.arange(MAP_HEIGHT) + 0.5)
    # Row 0 by its outer edge, where most of its weight lies: its middle would spread a lamp over a third of the circle.
    half_width = 1 / np.maximum(np.sin(colatitude), np.sin(height))
    step = np.arange(MAP_WIDTH)
    distance = np.minimum(step, MAP_WIDTH - step)
    kernel = np.maximum(0.0, 1 - distance / half_width[:, None])
    kernel /= kernel.sum(axis=1, keepdims=True)
    return np.asarray(kernel[:, (step[:, None] - step) % MAP_WIDTH], np.float32)


def padded_positions(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> tuple[Floats32, Floats32]:
    """Continuous (row, column) on an extended map of unit vectors given by components of one shape (...).

    Rows lie in [0, 33]; columns in [½, 64½], column 0 being a copy of column 64: bilinear interpolation never leaves
    the map.
    """
    row = np.interp(np.negative(y), -_knots(), np.arange(POLE_PADDED_ROWS)).astype(np.float32)
    column = np.arctan2(x, z) * np.float32(MAP_WIDTH / (2 * np.pi)) + np.float32((MAP_WIDTH + 1) / 2)
    return row, column.astype(np.float32)


def pad_poles(light_map: Floats32) -> Floats32:
    """Map (34, 66, 3) to interpolate bilinearly at `padded_positions`, of a light map (32, 64, 3)."""
    smooth = np.matmul(_theta_blur(), light_map)
    extended = np.empty((POLE_PADDED_ROWS, MAP_WIDTH + 2, 3), np.float32)
    inner = extended[:, 1:-1]
    inner[2:-2] = smooth[1:-1]
    for pole, near, first, second in _POLES:
        inner[pole] = smooth[first].mean(axis=0)
        inner[near] = (1 - _POLE_MIX) * smooth[first] + _POLE_MIX * smooth[second]
    extended[:, 0], extended[:, -1] = extended[:, -2], extended[:, 1]
    return extended


def splat(direction: NDArray[np.float64], energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Radiance (32, 64) of point lights: unit vectors (count, 3) with energies (count,).

    Σ radiance · solid angle is Σ energy, and light spread evenly over the sphere gives an even map.
    """
    row, column = padded_positions(*direction.T)
    top = np.minimum(row.astype(np.intp), POLE_PADDED_ROWS - 2)
    left = np.floor(column).astype(np.intp)
    down, right = row - top, column - left
    extended = np.zeros((POLE_PADDED_ROWS, MAP_WIDTH))
    for row_step, row_weight in ((0, 1 - down), (1, down)):
        for column_step, column_weight in ((0, 1 - right), (1, right)):
            # Extended columns count from 1.
            index = (top + row_step) * MAP_WIDTH + (left + column_step - 1) % MAP_WIDTH
            extended += np.bincount(index, energy * row_weight * column_weight, extended.size).reshape(extended.shape)
    folded = np.zeros((MAP_HEIGHT, MAP_WIDTH))
    folded[1:-1] = extended[2:-2]
    for pole, near, first, second in _POLES:
        folded[first] += extended[pole].mean() + (1 - _POLE_MIX) * extended[near]
        folded[second] += _POLE_MIX * extended[near]
    spread: NDArray[np.float64] = np.matmul(_theta_blur().astype(np.float64), folded[..., None])[..., 0]
    return spread / texel_solid_angles()


LightMap = NDArray[np.float32]
"""(32, 64, 3) float32 linear RGB radiance, row 0 up, the middle toward the camera (see `light.directions`)."""

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


def _overlap_weights(edges_in: NDArray[np.float64], edges_out: NDArray[np.float64]) -> NDArray[np.float32]:
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
    rows = _overlap_weights(*(-np.cos(np.linspace(0, np.pi, n + 1)) for n in (rows_in, height)))
    columns = _overlap_weights(*(np.linspace(0, 1, n + 1) for n in (columns_in, width)))
    shrunk = (rows @ radiance.reshape(rows_in, -1)).reshape(height, columns_in, 3)
    return np.ascontiguousarray(np.matmul(columns, shrunk), dtype=np.float32)


def resample_to_light_map(radiance: NDArray[np.float32]) -> LightMap:
    """The light map of panorama radiance (h, w, 3) in map axes, of any size; Σ E·ω is kept to 1e-5."""
    return resample_by_area(radiance, MAP_HEIGHT, MAP_WIDTH)


@lru_cache(maxsize=1)
def _rotation_samples() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
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


def rotate_light_map(light_map: LightMap, rotation: Rotation) -> LightMap:
    """The light map seen from a rotated frame: E_out(l) = E_in(R·l), radiance stays non-negative.

    For a head turned by R in the room (head-frame vectors to room-frame vectors) it is the light in the head's frame.
    Every texel averages samples of the conserving interpolation in `light.light_map_rotation`, so a constant map stays
    constant, a
    lamp keeps its energy within 1 % wherever it stands and goes, and the whole map, per channel, exactly. The identity
    returns the input.
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
