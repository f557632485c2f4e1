"""Which light a subject was measured in: directions, and the share of a light that comes from them.

A direction counts as measured where captured lights are around it: where no cap of `MAX_GAP_DEG` without a light in it
contains it (the morphological closing of the lights by such caps). That is the region of the Delaunay triangles which
interpolate between captured lights, to half a texel along its edge, without their geometry.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.light.directions import fibonacci_directions, texel_directions, texel_solid_angles
from relit_camera.light.light_map import LightMap

MAX_GAP_DEG = 60.0
"""Angular radius of the largest cap without a captured light that counts as sampled; wider ones are what was not."""
_CAPS = 2048
"""Caps that are tried, spread evenly: about one for each texel."""
_FEWEST_LIGHTS = 4
"""Fewer span no region."""


def measured_texels(light_directions: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which texels (32, 64) of a light map lie in measured directions; some milliseconds.

    Args:
        light_directions: (lights, 3) unit vectors toward the captured lights.
    """
    texels = texel_directions()
    if len(light_directions) < _FEWEST_LIGHTS:
        return np.zeros(texels.shape[:2], np.bool_)
    caps, reach = fibonacci_directions(_CAPS).astype(np.float32), np.cos(np.radians(MAX_GAP_DEG))
    empty = caps[(light_directions.astype(np.float32) @ caps.T).max(axis=0) < reach]
    nearest = (texels.reshape(-1, 3).astype(np.float32) @ empty.T).max(axis=1, initial=-1)
    return np.asarray((nearest <= reach).reshape(texels.shape[:2]))


def share_of_light(light_map: LightMap, texels: NDArray[np.bool_]) -> float:
    """Share 0..1 of a light map's energy that comes from some texels (32, 64); 0 where there is no light."""
    energy = luminance(light_map).astype(np.float64) * texel_solid_angles()
    return float(np.average(texels, weights=energy)) if energy.any() else 0.0


def measured_fraction(light_directions: NDArray[np.floating]) -> float:
    """Share 0..1 of the sphere that lights from `light_directions` (lights, 3) measure."""
    return share_of_light(np.ones((*texel_directions().shape[:2], 3), np.float32), measured_texels(light_directions))
