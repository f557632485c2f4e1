"""Automatic exposure: the scale at which pictures under an environment's light are shown."""

from __future__ import annotations

import numpy as np

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.color import LUMINANCE
from relit_camera.light.light_map import LightMap, irradiance, total

WHITE_BALL_LUMINANCE = 0.8
"""Displayed luminance of a white diffuse ball at the point that faces the camera."""
_MIN_FRONT_FRACTION = 0.2
"""Least share of the mean over the ball's whole surface that its facing point is taken to receive."""


def auto_exposure_scale(light_map: LightMap) -> float:
    """The factor by which linear pictures under `light_map` are multiplied to be shown; 1 for no light at all.

    With it the point of a white diffuse ball that faces the camera, irradiance Σ E·ω·max(0, z), has luminance 0.8, in
    units where a white wall facing a lamp of unit irradiance reads 1.

    Light from behind alone never reaches that point, and the scale would grow without bound. Below a fifth of the mean
    irradiance of the ball's surface, Σ E·ω / 4, the facing point is taken to receive that fifth: such a face is shown
    darker than others, a lamp right behind it at most 16 times its irradiance.
    """
    facing = float(irradiance(light_map, (0.0, 0.0, 1.0)) @ LUMINANCE)
    mean = float(total(light_map) @ LUMINANCE) / 4
    reference = max(facing, _MIN_FRONT_FRACTION * mean)
    return WHITE_BALL_LUMINANCE / reference if reference > 0 else 1.0


def facing_light(light_map: LightMap) -> Float32Array:
    """The light (3,) of a white diffuse ball at the point that faces the camera, with the least share of above."""
    return np.maximum(irradiance(light_map, (0.0, 0.0, 1.0)), _MIN_FRONT_FRACTION / 4 * total(light_map)).astype(
        np.float32
    )
