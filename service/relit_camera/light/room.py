"""The light that falls on the face in the room."""

from __future__ import annotations

import numpy as np

from relit_camera.config.look import Lighting
from relit_camera.light.environment import Environment
from relit_camera.light.lamps import lamp_map
from relit_camera.light.maps import LightMap, rotate
from relit_camera.space.colour import luminance
from relit_camera.space.directions import MAP_HEIGHT, MAP_WIDTH
from relit_camera.space.rotation import rotation_from_angles


def room_light(environment: Environment | None, lighting: Lighting) -> LightMap:
    """The environment turned by the lighting's angles, with its lamps added, in the lighting's saturation.

    E_room(l) = E_map(R⁻¹·l): yaw > 0 moves a frontal light to the picture's right. Saturation moves every texel, lamps
    included, toward or away from its luminance; what would fall below 0 is cut. Exposure is not applied.
    """
    light = np.zeros((MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
    if environment is not None:
        angles = rotation_from_angles(lighting.yaw_deg, lighting.pitch_deg, lighting.roll_deg)
        light = rotate(environment.light_map, angles.inv())
    if lighting.lamps:
        light += lamp_map(lighting.lamps)
    if lighting.saturation != 1:
        grey = luminance(light)[..., None]
        light = np.maximum(0, grey + np.float32(lighting.saturation) * (light - grey))
    return light
