"""Making the light map of a scene against its number of lamps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from relit_camera.base.config.look import Lamp, Lighting
from relit_camera.lab.bench.curves.cost_curve import CostCurve, median_processor_ms, one_thread
from relit_camera.lab.bench.mesh_run import MeshRun
from relit_camera.light.directions import fibonacci_directions, spherical_from_direction
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.scene_light import scene_light_map

LAMP_COUNTS = (0, 1, 2, 4, 8, 16, 24, 32)
"""A look may have 16."""
LAMP_SIZES_DEG = (10.0, 60.0)


def light_curve(
    mesh: MeshRun, environment: Environment, lamp_counts: Sequence[int] = LAMP_COUNTS, at_most_s: float = 0.3
) -> CostCurve:
    """The curve of making the light map of an environment, turned, with so many lamps of each of some sizes.

    Args:
        mesh: the unit; sampled here.
        environment: of the scene.
        lamp_counts: numbers of lamps.
        at_most_s: how long each point is measured.
    """
    with one_thread():
        found = {
            f"lamps of {size_deg:g}°": [
                median_processor_ms(partial(scene_light_map, environment, _lighting(count, size_deg)), at_most_s)
                for count in lamp_counts
            ]
            for size_deg in LAMP_SIZES_DEG
        }
    mesh.sample()
    caption = f"Making a light map of a turned environment ({environment.name}) and lamps."
    return CostCurve("light-map-lamps", "lamps", list(lamp_counts), caption, mesh.ms, found)


def _lighting(lamps: int, size_deg: float) -> Lighting:
    azimuth, elevation = np.degrees(spherical_from_direction(fibonacci_directions(lamps or 1)))
    made = tuple(
        Lamp(azimuth_deg=azimuth[i], elevation_deg=elevation[i], size_deg=size_deg, kelvin=3200) for i in range(lamps)
    )
    # A copy is not validated: more lamps than a look may have show where the curve goes.
    return Lighting(yaw_deg=30).model_copy(update={"lamps": made})
