"""Ground truth of a reflectance field: one-light pictures from directions all around."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import LightsError
from relit_camera.capture.lights_file import MIN_LIGHTS
from relit_camera.capture.reflectance.methods.barycentric_methods import PlanarBarycentric, SphericalBarycentric
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import texel_directions, texel_solid_angles
from relit_camera.light.light_map import LightMap

SAME_DIRECTION_DEG = 0.1
"""A truth light this near to a captured one is the same picture."""


@dataclass(frozen=True)
class GroundTruth:
    """True one-light pictures at arbitrary directions.

    Every texel of the 64 × 32 light map is assigned to the nearest truth light, which gets its weight and its light.
    Lights at all texel centers, as in thesis 7, get one texel each.

    Attributes:
        samples: the pictures.
    """

    samples: OlatSamples

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors (lights, 3)."""
        return self.samples.directions

    @cached_property
    def inside(self) -> NDArray[np.intp]:
        """Pixels of the person, row-major indices (pixels,)."""
        return np.flatnonzero(self.samples.matte > 0.5)

    @cached_property
    def colors(self) -> NDArray[np.float32]:
        """The pictures' pixels inside the matte, (lights, pixels, 3)."""
        return pixel_colors(self.samples, self.inside)

    @cached_property
    def light_of_texel(self) -> NDArray[np.intp]:
        """Truth light nearest to each texel (2048,); -1 where the truth has no lights."""
        texels = texel_directions().reshape(-1, 3)
        nearest = (texels @ self.directions.T).argmax(axis=1)
        nearest[~SphericalBarycentric().weights(self.directions, texels).any(axis=0)] = -1
        return np.asarray(nearest, np.intp)

    @cached_property
    def weights(self) -> NDArray[np.float64]:
        """Each light's fraction (lights,) in the error measure: cos φ, summed over its texels (thesis 7)."""
        texels = texel_directions().reshape(-1, 3)
        return self._summed(np.hypot(texels[:, 0], texels[:, 2])[:, None])[:, 0]

    def irradiance(self, light_map: LightMap) -> NDArray[np.float32]:
        """A light map as lights of these directions: Σ E·ω over each one's texels, (lights, 3)."""
        return self._summed((light_map * texel_solid_angles()[..., None]).reshape(-1, 3)).astype(np.float32)

    def picture(self, colors: NDArray[np.floating]) -> NDArray[np.float32]:
        """A picture (height, width, channels), or (height, width), of values of the pixels inside; 0 elsewhere."""
        height, width = self.samples.matte.shape
        picture = np.zeros((height * width, *colors.shape[1:]), np.float32)
        picture[self.inside] = colors
        return picture.reshape(height, width, *colors.shape[1:])

    def _summed(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        known = self.light_of_texel >= 0
        sums = np.zeros((len(self.directions), values.shape[1]))
        np.add.at(sums, self.light_of_texel[known], values[known])
        return sums


def pixel_colors(samples: OlatSamples, inside: NDArray[np.intp]) -> NDArray[np.float32]:
    """The pictures' colors (lights, pixels, 3) at row-major indices `inside`."""
    return samples.pictures.reshape(len(samples.pictures), -1, 3)[:, inside]


def sampled_region(directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which unit vectors (count, 3) lie in the hull of captured ones (lights, 3), on the sphere and on the flat map.

    On the sphere it is what their Delaunay triangles cover, those left out that close the part where nothing was
    captured; on the map, azimuth by elevation, their convex hull. Inside both every method of the thesis interpolates.

    Raises:
        LightsError: the directions span no region.
    """
    return np.asarray(
        SphericalBarycentric().weights(directions, queries).any(axis=0)
        & PlanarBarycentric().weights(directions, queries).any(axis=0)
    )


def not_captured(directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which unit vectors (count, 3) differ from all captured ones (lights, 3): (count,)."""
    nearest = (queries @ directions.T).max(axis=1)
    return np.asarray(nearest < np.cos(np.radians(SAME_DIRECTION_DEG)))


def subsample_lights(samples: OlatSamples, within_deg: float | None = None, every: int = 1) -> OlatSamples:
    """Every N-th (`every`) of the lights that are at most `within_deg` from the camera's axis, in reach of a hand.

    Raises:
        LightsError: fewer than four are left.
    """
    axis = samples.directions[:, 2]
    near = np.flatnonzero(axis >= np.cos(np.radians(within_deg))) if within_deg else np.arange(len(axis))
    return select_lights(samples, near[::every])


def select_lights(samples: OlatSamples, lights: NDArray[np.intp]) -> OlatSamples:
    """The samples of these lights (some,).

    Raises:
        LightsError: fewer than four.
    """
    if len(lights) < MIN_LIGHTS:
        raise LightsError(f"{len(lights)} captured lights are left", f"keep {MIN_LIGHTS} or more")
    return OlatSamples(samples.pictures[lights], samples.directions[lights], samples.matte)
