"""Fields that mix the three captured lights around a direction with weights that differ from pixel to pixel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.reflectance.delaunay_triangulation import TriangleLookup, find_triangles
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.subject.reflectance_field import texel_vectors

Values = NDArray[np.float32]

BLOCK = 1 << 17
"""Pairs of direction and pixel mixed at a time: 4.7 MB of colours."""


@dataclass(frozen=True)
class TriangleVertices:
    """Query directions, the triangle of captured lights around each, and a block of pixels.

    Attributes:
        lights: (lights, 3) float64 unit vectors of all lights.
        queries: (count, 3) float64 unit vectors inside the triangles.
        triangles: (count, 3) indices of the lights at the corners.
        weights: (count, 3, 1) float32 barycentric.
        colors: (count, 3, channels, pixels) float32 of the corners' pictures; pixels last, for fast inner loops.
        geometry: the person's geometry.
        pixels: (pixels,) row-major indices.
    """

    lights: NDArray[np.float64]
    queries: NDArray[np.float64]
    triangles: NDArray[np.intp]
    weights: Values
    colors: Values
    geometry: Geometry
    pixels: NDArray[np.intp]

    def subset(self, chosen: NDArray[np.bool_]) -> TriangleVertices:
        """The same for the queries chosen by a mask (count,)."""
        return replace(
            self,
            queries=self.queries[chosen],
            triangles=self.triangles[chosen],
            weights=self.weights[chosen],
            colors=self.colors[chosen],
        )

    @cached_property
    def cosines(self) -> tuple[Values, Values]:
        """n·l at the corners (count, 3, pixels) and at the queries (count, pixels)."""
        return self.around(self.geometry.cosines)

    def around(self, function: Callable[[NDArray[np.float64], NDArray[np.intp]], NDArray]) -> tuple[NDArray, NDArray]:
        """Values of a function of directions and pixels, at corners (count, 3, pixels) and queries (count, pixels)."""
        return function(self.lights, self.pixels).T[self.triangles], function(self.queries, self.pixels).T


VertexMix = Callable[[TriangleVertices], Values]
"""A function that gives the colors (count, channels, pixels) of the queries."""


def barycentric_mix(weights: Values, colors: Values) -> Values:
    """Sum over corners of weights (count, 3, pixels or 1) times colors (count, 3, channels, pixels)."""
    # Corner by corner: many times as fast as a sum over an axis of three.
    first, second, third = (weights[:, corner, None] * colors[:, corner] for corner in range(3))
    return np.asarray(first + second + third)


@dataclass(frozen=True)
class TriangleField:
    """A field whose values `mix` computes from the corners; black where no triangle is.

    Attributes:
        samples: the captured lights.
        mix: gives the colors of queries from those of their corners.
    """

    samples: OlatSamples
    mix: VertexMix

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.samples.pictures.shape[1], self.samples.pictures.shape[2]

    def dense(self, start: int, stop: int) -> Values:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        found = self._evaluate(texel_vectors(), self._texels, np.arange(start, stop))
        return np.ascontiguousarray(found.transpose(1, 0, 2))

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Values:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        return self._evaluate(directions, find_triangles(self.samples.directions, directions), pixels)

    @cached_property
    def _texels(self) -> TriangleLookup:
        return find_triangles(self.samples.directions, texel_vectors())

    def _evaluate(self, directions: NDArray[np.float64], found: TriangleLookup, pixels: NDArray[np.intp]) -> Values:
        lights = self.samples.directions
        pictures = self.samples.pictures.reshape(len(lights), -1, 3)
        result = np.zeros((len(directions), len(pixels), 3), np.float32)
        step = max(1, BLOCK // max(1, len(found.covered)))
        for start in range(0, len(pixels), step):
            block = pixels[start : start + step]
            corners = TriangleVertices(
                lights=lights,
                queries=directions[found.covered],
                triangles=found.corners,
                weights=found.weights[..., None],
                colors=np.ascontiguousarray(pictures[:, block].transpose(0, 2, 1))[found.corners],
                geometry=self.samples.geometry,
                pixels=block,
            )
            result[found.covered, start : start + step] = self.mix(corners).transpose(0, 2, 1)
        return result
