"""Sculpted short hair, combed back, as shop-window mannequins have it."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import LinearNDInterpolator, PchipInterpolator

from relit_camera.base.array_types import Float64Array
from relit_camera.base.rotations import rotation_from_angles
from relit_studio.mannequin.shape.head import SKULL_CENTER
from relit_studio.mannequin.shape.part import HAIR, Part, grid_part
from relit_studio.mannequin.shape.texture_atlas import SKIN_TONE

_HAIRLINE_DEG = np.array(
    [
        *([0, 45], [20, 45], [36, 47], [50, 55], [62, 68], [73, 88], [81, 107]),
        *([89, 108], [95, 95], [110, 91], [124, 98], [138, 119], [155, 127], [180, 130]),
    ]
)
"""Azimuth (0 the front, the same to both sides) and the hairline's angle from the top, about the skull's center."""
_TONE = np.array([0.085, 0.048, 0.028])
_COMBED_DEG = -62.0
"""Azimuth of the axis that the strands follow."""
_ROWS, _COLUMNS = 72, 240


def hair(skin: Float64Array) -> Part:
    """Hair on a head at rest whose skin's vertices (count, 3) are given."""
    azimuth = np.linspace(-np.pi, np.pi, _COLUMNS, endpoint=False)
    # The shell starts a little off the top, where a fine fan would shade badly, and ends under the skin.
    fraction = np.concatenate([np.linspace(0.01, 0.9, _ROWS - 16), np.linspace(0.91, 1.0, 16)])[:, None]
    random = np.random.default_rng(11)
    jag = sum(np.sin(azimuth * n + random.uniform(0, 6.3)) for n in (7, 13, 29, 53)) * 0.4
    line = np.radians(PchipInterpolator(*_HAIRLINE_DEG.T)(np.degrees(np.abs(azimuth))) + jag)
    line = line + np.radians(5) * np.sin(azimuth) * np.clip(np.cos(azimuth), 0, 1)
    polar = fraction * line
    direction = np.stack(
        [np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth, np.sin(polar) * np.cos(azimuth)], axis=-1
    )
    strands = _strands(direction, random)
    thickness = _thickness(fraction, azimuth, polar) * (1 + 0.07 * strands) - 0.1
    radius = _head_radius(skin, polar, azimuth) + thickness
    vertices = SKULL_CENTER + direction * radius[..., None]
    color = _TONE * (1 + 0.4 * strands)[..., None]
    # Single hairs thin out towards the hairline: the skin shines through.
    fade = np.clip((fraction - 0.93) / 0.07, 0, 1)[..., None] ** 2 * 0.45
    color = color + (SKIN_TONE * 0.8 - color) * fade
    return grid_part("hair", vertices, color, HAIR, closed=True, caster_step=6)


def _head_radius(skin: Float64Array, polar: Float64Array, azimuth: Float64Array) -> Float64Array:
    """Distance of the head's surface from the skull's center, in directions by angle from the top and azimuth."""
    offset = skin - SKULL_CENTER
    radius = np.linalg.norm(offset, axis=1)
    angle, around = np.arccos(offset[:, 1] / radius), np.arctan2(offset[:, 0], offset[:, 2])
    near = angle < np.radians(150)
    surface = LinearNDInterpolator(
        np.stack([angle * np.sin(around), angle * np.cos(around)], axis=1)[near], radius[near]
    )
    return np.asarray(surface(polar * np.sin(azimuth), polar * np.cos(azimuth)))


def _thickness(fraction: Float64Array, azimuth: Float64Array, polar: Float64Array) -> Float64Array:
    """Centimeters of hair: full on top, swept up over the forehead to one side, short round the ears and neck."""
    front = np.exp(-(((azimuth - 0.15) / 0.85) ** 2))
    short = np.clip((np.degrees(polar) - 55) / 45, 0, 1)
    body = 1.75 - 1.15 * short
    quiff = 1.25 * front * np.exp(-(((fraction - 0.66) / 0.27) ** 2))
    edge = np.clip(1 - fraction**5, 0, 1) ** (0.5 + 0.3 * front)
    return np.asarray((body + quiff) * edge)


def _strands(direction: Float64Array, random: np.random.Generator) -> Float64Array:
    """About -1..1 (rows, columns): locks combed from the forehead at the picture's left over to the back right."""
    combed = direction @ rotation_from_angles(_COMBED_DEG).as_matrix()
    x, y, z = np.moveaxis(combed, -1, 0)
    # Planes through a long axis cut the head along combed strands.
    across = np.arctan2(x, y + 0.35) + 0.08 * np.sin(4 * z + 2 * x)
    locks = np.zeros_like(across)
    for count, weight in ((9, 0.25), (23, 0.3), (41, 0.4), (67, 0.45), (89, 0.4)):
        wave = 0.3 * np.sin(3.0 * z + random.uniform(0, 6.3))
        locks += weight * np.sin(across * count + random.uniform(0, 6.3) + wave * count / 20)
    return np.asarray(locks / 1.2)
