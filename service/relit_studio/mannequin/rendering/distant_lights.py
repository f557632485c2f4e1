"""Distant lights: single lamps, a soft room, and light maps approximated by a few lights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.config.look import Lamp
from relit_camera.base.images.color import LUMINANCE
from relit_camera.light.directions import texel_directions, texel_solid_angles
from relit_camera.light.light_map import LightMap, check_light_map
from relit_camera.light.scene_light import lamp_light_map


@dataclass(frozen=True, eq=False)
class DistantLights:
    """Lights at infinity.

    Attributes:
        directions: (count, 3) float64 unit vectors toward them, room axes.
        irradiance: (count, 3) float64 linear RGB, each on a surface that faces it.
    """

    directions: NDArray[np.float64]
    irradiance: NDArray[np.float64]


def room() -> LightMap:
    """A soft room: a large window at the picture's left, a lamp at the right, pale walls and a darker floor."""
    lamps = (
        Lamp(azimuth_deg=-38, elevation_deg=28, size_deg=70, kelvin=6000, intensity=1.5),
        Lamp(azimuth_deg=48, elevation_deg=22, size_deg=50, kelvin=4000, intensity=0.55),
    )
    height = texel_directions()[..., 1:2]
    walls = 0.16 + 0.06 * np.clip(height, -1, 1)
    return np.asarray(lamp_light_map(lamps) + walls * np.array([1.0, 0.96, 0.9]), np.float32)


def lights_from_map(light_map: LightMap, count: int) -> DistantLights:
    """At most `count` distant lights that approximate a light map, each with about the same energy.

    Median cut (Debevec 2006): the map is halved again and again so that both halves are as bright; a region's light
    stands at its centroid and gives its whole energy Σ E·ω, so that the energy is kept per channel. Black regions give
    no light.

    Raises:
        ImageError: not a light map.
    """
    check_light_map(light_map)
    energy = light_map * texel_solid_angles()[..., None]
    brightness = energy @ LUMINANCE.astype(np.float64)
    regions = [(slice(0, brightness.shape[0]), slice(0, brightness.shape[1]))]
    while len(regions) < count:
        weights = [brightness[region].sum() if brightness[region].size > 1 else 0.0 for region in regions]
        largest = int(np.argmax(weights))
        if weights[largest] <= 0:
            break
        regions[largest : largest + 1] = _halves(brightness, regions[largest])
    lit = [region for region in regions if energy[region].sum() > 0]
    directions = np.array([_centroid(brightness[region], texel_directions()[region]) for region in lit]).reshape(-1, 3)
    return DistantLights(directions, np.array([energy[region].sum(axis=(0, 1)) for region in lit]).reshape(-1, 3))


def _halves(brightness: NDArray, region: tuple[slice, slice]) -> list[tuple[slice, slice]]:
    rows, columns = region
    part = brightness[region]
    # A column is narrower towards the poles.
    middle = np.pi * (0.5 - (rows.start + rows.stop) / 2 / brightness.shape[0])
    wide = part.shape[1] * np.cos(middle) >= part.shape[0] or part.shape[0] == 1
    along = int(wide and part.shape[1] > 1)
    sums = np.cumsum(part.sum(axis=1 - along))
    cut = int(np.clip(np.searchsorted(sums, sums[-1] / 2) + 1, 1, len(sums) - 1))
    if along == 0:
        split = rows.start + cut
        return [(slice(rows.start, split), columns), (slice(split, rows.stop), columns)]
    split = columns.start + cut
    return [(rows, slice(columns.start, split)), (rows, slice(split, columns.stop))]


def _centroid(brightness: NDArray, directions: NDArray) -> NDArray:
    summed = np.einsum("ij,ijk->k", brightness, directions)
    length = np.linalg.norm(summed)
    # Light from all sides alike has no middle; it does not happen in a region of a divided map.
    return np.asarray(summed / length if length > 0 else directions[0, 0])
