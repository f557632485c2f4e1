"""The light on the face: an environment, turned and in its saturation, plus round lamps at infinity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.config.look import Lamp, Lighting
from relit_camera.base.images.color import luminance, rgb_from_kelvin
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.light_map import LightMap, irradiance
from relit_camera.light.light_map_interpolation import splat
from relit_camera.light.light_map_rotation import rotate_light_map

_POINTS_PER_STERADIAN = 1600
_MIN_POINTS = 64
"""A lamp's disc has so many points by its solid angle, but at least these."""


def lamp_light_map(lamps: Sequence[Lamp]) -> LightMap:
    """The light map of those of `lamps` that are not muted: discs of uniform radiance, intensity times color.

    A lamp's intensity is the irradiance Σ E·ω·max(0, n·l) on a surface that faces it. The disc consists of evenly
    spread points that are splatted by energy, so it moves smoothly however small it is; one smaller than a texel comes
    out about a texel wide.
    """
    light_map = np.zeros((MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
    for lamp in lamps:
        if lamp.muted:
            continue
        light_map += _disc(lamp)[..., None] * (_lamp_color(lamp) * np.float32(lamp.intensity))
    return light_map


def _lamp_color(lamp: Lamp) -> NDArray[np.float32]:
    if lamp.kelvin is not None:
        return rgb_from_kelvin(lamp.kelvin)
    return np.asarray(lamp.color if lamp.color is not None else (1, 1, 1), np.float32)


def _disc(lamp: Lamp) -> NDArray[np.float32]:
    """Radiance (32, 64) of a white lamp that gives unit irradiance."""
    rotation = rotation_from_angles(lamp.azimuth_deg, -lamp.elevation_deg)
    # sin² of the quarter angle: 1 − cos of half a tenth of a degree would have no digits left.
    height = 2 * np.sin(np.radians(lamp.size_deg) / 4) ** 2
    count = max(_MIN_POINTS, round(2 * np.pi * height * _POINTS_PER_STERADIAN))
    points = rotation.apply(_fibonacci_cap(count, height))
    radiance = np.repeat(splat(points, np.full(count, 1 / count))[..., None], 3, axis=2).astype(np.float32)
    facing = rotation.apply([0.0, 0.0, 1.0])
    return np.asarray(radiance[..., 0] / irradiance(radiance, facing)[0], np.float32)


def _fibonacci_cap(count: int, height: float) -> NDArray[np.float64]:
    """Unit vectors (count, 3) spread evenly over the cap 1 − z < `height` (Vogel 1979)."""
    depth = height * (np.arange(count) + 0.5) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(depth * (2 - depth))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 1 - depth], axis=1)


def scene_light_map(environment: Environment | None, lighting: Lighting) -> LightMap:
    """The environment turned by the lighting's angles, with its lamps added, in the lighting's saturation.

    E_scene(l) = E_map(R⁻¹·l): yaw > 0 moves a frontal light to the picture's right. Saturation moves every texel, lamps
    included, toward or away from its luminance; negative values are clamped to 0. Exposure is not applied.
    """
    light = np.zeros((MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
    if environment is not None:
        angles = rotation_from_angles(lighting.yaw_deg, lighting.pitch_deg, lighting.roll_deg)
        light = rotate_light_map(environment.light_map, angles.inv())
    if lighting.lamps:
        light += lamp_light_map(lighting.lamps)
    if lighting.saturation != 1:
        gray = luminance(light)[..., None]
        light = np.maximum(0, gray + np.float32(lighting.saturation) * (light - gray))
    return light
