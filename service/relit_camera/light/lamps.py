"""Round lamps at infinity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relit_camera.config.look import Lamp
from relit_camera.light.maps import LightMap, irradiance
from relit_camera.light.sphere import splat
from relit_camera.space.colour import rgb_from_kelvin
from relit_camera.space.directions import MAP_HEIGHT, MAP_WIDTH
from relit_camera.space.rotation import rotation_from_angles

_POINTS_PER_STERADIAN = 1600
_FEWEST_POINTS = 64


def lamp_map(lamps: Sequence[Lamp]) -> LightMap:
    """The light map of `lamps`: discs of even radiance, each giving its intensity times its colour.

    A lamp's intensity is the irradiance Σ E·ω·max(0, n·l) on a surface that faces it. The disc is made of points spread
    evenly and splatted by energy, so that it moves smoothly however small it is; one smaller than a texel is about a
    texel wide.
    """
    light_map = np.zeros((MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
    for lamp in lamps:
        light_map += _disc(lamp)[..., None] * (_colour(lamp) * np.float32(lamp.intensity))
    return light_map


def _colour(lamp: Lamp) -> NDArray[np.float32]:
    if lamp.kelvin is not None:
        return rgb_from_kelvin(lamp.kelvin)
    return np.asarray(lamp.color if lamp.color is not None else (1, 1, 1), np.float32)


def _disc(lamp: Lamp) -> NDArray[np.float32]:
    """Radiance (32, 64) of a white lamp that gives unit irradiance."""
    rotation = rotation_from_angles(lamp.azimuth_deg, -lamp.elevation_deg)
    # sin² of the quarter angle: 1 − cos of half a tenth of a degree would have no digits left.
    height = 2 * np.sin(np.radians(lamp.size_deg) / 4) ** 2
    count = max(_FEWEST_POINTS, round(2 * np.pi * height * _POINTS_PER_STERADIAN))
    points = rotation.apply(_sunflower(count, height))
    radiance = np.repeat(splat(points, np.full(count, 1 / count))[..., None], 3, axis=2).astype(np.float32)
    facing = rotation.apply([0.0, 0.0, 1.0])
    return np.asarray(radiance[..., 0] / irradiance(radiance, facing)[0], np.float32)


def _sunflower(count: int, height: float) -> NDArray[np.float64]:
    """Unit vectors (count, 3) spread evenly over the cap 1 − z < `height` (Vogel 1979)."""
    depth = height * (np.arange(count) + 0.5) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(depth * (2 - depth))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 1 - depth], axis=1)
