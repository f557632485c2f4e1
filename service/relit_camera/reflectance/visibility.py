"""Interpolation that knows where shadows end: visibility maps (thesis 5.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from relit_camera.geometry.geometry import Geometry
from relit_camera.reflectance.samples import Samples
from relit_camera.reflectance.triangles import Corners, TriangleField, Values, barycentric
from relit_camera.space.directions import (
    MAP_HEIGHT,
    MAP_WIDTH,
    direction_from_spherical,
    spherical_from_direction,
)

Interpolate = Callable[[Values, Corners], Values]
"""Weights (count, 3, pixels) of the corners that are lit → colours (count, channels, pixels)."""


@dataclass(frozen=True)
class Visibility:
    """Between a light that a pixel sees and one that it does not, the colour changes where the shadow's edge is.

    The visibility map is smoothed by a 3 × 3 box of texels unless `smooth` is False, where it is 0 or 1.
    """

    smooth: bool = True

    def build(self, samples: Samples) -> TriangleField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        return TriangleField(samples, self.mix)

    def mix(self, corners: Corners) -> Values:
        """See `triangles.Mix`."""
        return by_visibility(corners, visibility_map(corners, self.smooth), lambda w, c: barycentric(w, c.colours))


@dataclass(frozen=True)
class SharpVisibility(Visibility):
    """With the map as it is: shadows have hard edges, in the wrong place where the shape is wrong."""

    smooth: bool = False


def visibility_map(corners: Corners, smooth: bool) -> tuple[Values, Values]:
    """How far light reaches the pixels, 0 to 1: at the corners (count, 3, pixels), at the queries (count, pixels)."""

    def known(directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Values:
        if smooth:
            return smoothed_visibility(corners.geometry, directions, pixels)
        return corners.geometry.visible(directions, pixels).astype(np.float32)

    return corners.around(known)


def smoothed_visibility(geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Values:
    """The visibility map through a 3 × 3 box filter: (pixels, count) of unit vectors (count, 3).

    At a texel's centre that is the mean over it and its eight neighbours; elsewhere, over as many directions likewise
    apart.
    """
    azimuth, elevation = spherical_from_direction(directions)
    steps = list(product((-1, 0, 1), repeat=2))
    total = np.zeros((len(pixels), len(directions)), np.float32)
    for across, up in steps:
        shifted = direction_from_spherical(
            azimuth + across * 2 * np.pi / MAP_WIDTH, elevation + up * np.pi / MAP_HEIGHT
        )
        total += geometry.visible(shifted, pixels)
    return total / np.float32(len(steps))


def by_visibility(corners: Corners, visibility: tuple[Values, Values], lit_colours: Interpolate) -> Values:
    """Colours (count, channels, pixels) by the rule of thesis 5.3.

    The corner seen least counts as in shadow, the one seen most as lit. The third is taken once as lit and once as in
    shadow, and both are mixed by how near it is to those two. Each time the colour goes from that of the corners in
    shadow to that of those lit, over the visibility between them; at a corner it is that corner's. The more the corners
    differ, the more this counts; where they are seen alike, plain interpolation does.

    Args:
        corners: the triangles.
        visibility: see `visibility_map`.
        lit_colours: how the colours of lit corners are interpolated.
    """
    seen, here = visibility
    order = np.argsort(seen, axis=1, kind="stable")
    rank = np.argsort(order, axis=1)
    least, middle, most = np.take_along_axis(seen, order, axis=1).transpose(1, 0, 2)
    as_lit = _share(middle, least, most)
    stepped = np.zeros_like(corners.colours[:, 0])
    for first_lit, low, high, weight in ((1, least, middle, as_lit), (2, middle, most, 1 - as_lit)):
        is_lit = rank >= first_lit
        lit = lit_colours(_only(corners.weights, is_lit), corners)
        dark = barycentric(_only(corners.weights, ~is_lit), corners.colours)
        stepped += weight[:, None] * (dark + _share(here, low, high)[:, None] * (lit - dark))
    plain = barycentric(corners.weights, corners.colours)
    return np.asarray(plain + (most - least)[:, None] * (stepped - plain))


def _share(value: Values, low: Values, high: Values) -> Values:
    """Where between two others a value lies: 0 at the lower or below, 1 at the higher or above; 1 where they agree."""
    span = high - low
    return np.where(span > 0, np.clip((value - low) / np.maximum(span, 1e-6), 0, 1), np.float32(1)).astype(np.float32)


def _only(weights: Values, chosen: NDArray[np.bool_]) -> Values:
    """Weights (count, 3, pixels) of the chosen corners alone, made to sum to 1; equal ones where all theirs are 0."""
    kept = weights * chosen + np.float32(1e-7) * chosen
    return np.asarray(kept / kept.sum(axis=1, keepdims=True))
