"""Neck, shoulders and a pullover."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from relit_camera.base.array_types import Float64Array
from relit_studio.mannequin.shape.part import CLOTH, SKIN, Part, grid_part
from relit_studio.mannequin.shape.texture_atlas import SKIN_TONE

_PROFILE = np.array(
    [
        [-28.0, 20.6, 10.8, -4.2],
        [-22.0, 19.6, 9.9, -4.6],
        [-18.5, 17.4, 8.6, -5.0],
        [-16.6, 13.8, 7.4, -5.2],
        [-15.0, 10.0, 6.5, -5.2],
        [-13.0, 6.9, 5.7, -5.0],
        [-11.0, 5.6, 5.3, -4.7],
        [-8.0, 5.2, 5.2, -4.3],
        [-3.0, 4.8, 4.2, -4.6],
    ]
)
"""Height, half width, half depth and middle Z of the body's cross sections, in centimeters."""
_COLLAR = np.array([[-0.6, -0.3], [0.1, -0.05], [0.42, 0.1], [0.45, 0.32], [0.2, 0.55], [-0.4, 0.66], [-1.05, 0.6]])
"""Height over the neckline and distance from the body of the rolled collar's section, from inside to outside."""
_CLOTH_TONE = np.array([0.060, 0.105, 0.165])
_AROUND = np.linspace(-np.pi, np.pi, 96, endpoint=False)


def neck() -> Part:
    """Neck and upper chest, in head axes at rest."""
    heights = np.linspace(-3, -17.5, 40)[:, None] * np.ones_like(_AROUND)
    tone = SKIN_TONE * [1, 0.97, 0.96]
    return grid_part("neck", _body(heights, 0.0), tone, SKIN, closed=True, caster_step=4)


def pullover() -> Part:
    """A pullover with a rolled crew neck, in head axes at rest."""
    neckline = -13.6 - 1.5 * np.clip(np.cos(_AROUND), 0, 1) ** 2 + 1.0 * np.clip(-np.cos(_AROUND), 0, 1)
    collar_heights = neckline + _COLLAR[:, :1]
    fall = np.linspace(0, 1, 40)[:, None] ** 1.3
    start = neckline - 1.15
    body_heights = start + (-28 - start) * fall
    heights = np.concatenate([collar_heights, body_heights])
    offsets = np.concatenate([_COLLAR[:, 1], 0.42 - 0.1 * fall[:, 0]])[:, None]
    vertices = _body(heights, offsets)
    rib = np.sin(_AROUND * 60)
    shade = np.concatenate([np.tile(1.25 + 0.12 * rib, (len(_COLLAR), 1)), np.ones_like(body_heights)])
    color = _CLOTH_TONE * shade[..., None]
    return grid_part("pullover", vertices, color, CLOTH, closed=True, caster_step=4)


def base() -> Part:
    """The pullover's lower end, closed, below every picture: light from below must not shine through the body."""
    edge = _body(np.full((1, len(_AROUND)), _PROFILE[0, 0]), 0.32)
    middle = edge.mean(axis=1, keepdims=True)
    shrunk = np.array([1, 0.5, 0.01])[:, None, None]
    return grid_part("base", middle + shrunk * (edge - middle), _CLOTH_TONE, CLOTH, closed=True, caster_step=1)


def _body(heights: Float64Array, offset: ArrayLike) -> Float64Array:
    """Points (rows, columns, 3) of the body at these heights (rows, columns), `offset` away from it."""
    profile = PchipInterpolator(_PROFILE[:, 0], _PROFILE[:, 1:])(np.clip(heights, -28, -3))
    width, depth, middle = np.moveaxis(profile, -1, 0)
    return np.stack(
        [(width + offset) * np.sin(_AROUND), heights, middle + (depth + offset) * np.cos(_AROUND)],
        axis=-1,
    )
