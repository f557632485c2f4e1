"""Interpolation on a light map that conserves energy, poles included, and its adjoint, which splats point lights.

Bilinear interpolation in (θ, φ) gives a lamp in row 0 8 % too much energy, since its weight is not spread by solid
angle. Linear interpolation in sin φ between knots y_i = sin φ_i / cos(Δφ/2) is exact: the weight function of texel i
integrates to (y_{i-1} − y_{i+1}) / 2 · Δθ, and sin φ_{i-1} − sin φ_{i+1} = 2 sin Δφ cos φ_i is 2 cos(Δφ/2) times
sin φ_top − sin φ_bottom, so the integral is the texel's solid angle. The first and last knot fall on the poles.

Polar texels are narrow in θ: a row is blurred along θ until every texel is about as wide as one at the equator. Both
steps are linear, keep a constant map constant and keep each texel's energy, and `splat` is the exact adjoint of
interpolating a padded map at `padded_positions`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, texel_solid_angles

Floats32 = NDArray[np.float32]

POLE_PADDED_ROWS = MAP_HEIGHT + 2
"""Rows of a padded map: each polar row becomes two, its mean at the pole and a mixture with the next row near it."""
_POLE_MIX = 0.4
"""Share of the next row in that mixture, and its relative position in sin φ. With this value a lamp in row 0, or one
splatted near the pole, is displaced least (within a degree). Any value conserves energy."""
_POLES = ((0, 1, 0, 1), (-1, -2, -1, -2))
"""For each pole: padded rows at and near the pole, map rows at and next to it."""


@lru_cache(maxsize=1)
def _knots() -> NDArray[np.float64]:
    """Values of sin φ at the padded map's rows (34,), from the top down."""
    elevation = np.pi * (0.5 - (np.arange(MAP_HEIGHT) + 0.5) / MAP_HEIGHT)
    rows = np.sin(elevation) / np.cos(np.pi / (2 * MAP_HEIGHT))
    near = 1 - _POLE_MIX * (1 - rows[1])
    return np.concatenate([[1.0, near], rows[1:-1], [-near, -1.0]])


@lru_cache(maxsize=1)
def _theta_blur() -> Floats32:
    """Circulant matrices (32, 64, 64), one a row: symmetric, doubly stochastic, the identity near the equator."""
    height = np.pi / MAP_HEIGHT
    colatitude = height * (np.arange(MAP_HEIGHT) + 0.5)
    # Row 0 by its outer edge, where most of its weight lies: its center would spread a lamp over a third of the circle.
    half_width = 1 / np.maximum(np.sin(colatitude), np.sin(height))
    step = np.arange(MAP_WIDTH)
    distance = np.minimum(step, MAP_WIDTH - step)
    kernel = np.maximum(0.0, 1 - distance / half_width[:, None])
    kernel /= kernel.sum(axis=1, keepdims=True)
    return np.asarray(kernel[:, (step[:, None] - step) % MAP_WIDTH], np.float32)


def padded_positions(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> tuple[Floats32, Floats32]:
    """Continuous (row, column) on a padded map of unit vectors given by components of one shape (...).

    Rows lie in [0, 33]; columns in [½, 64½], column 0 being a copy of column 64: bilinear interpolation never leaves
    the map.
    """
    row = np.interp(np.negative(y), -_knots(), np.arange(POLE_PADDED_ROWS)).astype(np.float32)
    column = np.arctan2(x, z) * np.float32(MAP_WIDTH / (2 * np.pi)) + np.float32((MAP_WIDTH + 1) / 2)
    return row, column.astype(np.float32)


def pad_poles(light_map: Floats32) -> Floats32:
    """The padded map (34, 66, 3) of a light map (32, 64, 3), to interpolate bilinearly at `padded_positions`."""
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
            # Columns of the padded map count from 1.
            index = (top + row_step) * MAP_WIDTH + (left + column_step - 1) % MAP_WIDTH
            extended += np.bincount(index, energy * row_weight * column_weight, extended.size).reshape(extended.shape)
    folded = np.zeros((MAP_HEIGHT, MAP_WIDTH))
    folded[1:-1] = extended[2:-2]
    for pole, near, first, second in _POLES:
        folded[first] += extended[pole].mean() + (1 - _POLE_MIX) * extended[near]
        folded[second] += _POLE_MIX * extended[near]
    spread: NDArray[np.float64] = np.matmul(_theta_blur().astype(np.float64), folded[..., None])[..., 0]
    return spread / texel_solid_angles()
