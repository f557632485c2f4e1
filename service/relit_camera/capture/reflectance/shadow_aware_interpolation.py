"""Interpolation that knows where shadows end: visibility maps (thesis 5.3).

Interpolation that knows how squarely light falls on the skin: light adaptation (thesis 5.4).

The thesis's final method: smoothed visibility, light adaptation, the black ring (5.3 to 5.6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.reflectance.sampled_region import with_black_ring
from relit_camera.capture.reflectance.samples import Samples
from relit_camera.capture.reflectance.triangle_field import TriangleCorners, TriangleField, Values, barycentric_mix
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, direction_from_spherical, spherical_from_direction

Interpolate = Callable[[Values, TriangleCorners], Values]
"""Weights (count, 3, pixels) of the corners that are lit → colours (count, channels, pixels)."""


@dataclass(frozen=True)
class VisibilityInterpolation:
    """Between a light that a pixel sees and one that it does not, the colour changes where the shadow's edge is.

    The visibility map is smoothed by a 3 × 3 box of texels unless `smooth` is False, where it is 0 or 1.
    """

    smooth: bool = True

    def build(self, samples: Samples) -> TriangleField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        return TriangleField(samples, self.mix)

    def mix(self, corners: TriangleCorners) -> Values:
        """See `triangles.Mix`."""
        return interpolate_by_visibility(
            corners, visibility_map(corners, self.smooth), lambda w, c: barycentric_mix(w, c.colors)
        )


@dataclass(frozen=True)
class SharpVisibilityInterpolation(VisibilityInterpolation):
    """With the map as it is: shadows have hard edges, in the wrong place where the shape is wrong."""

    smooth: bool = False


def visibility_map(corners: TriangleCorners, smooth: bool) -> tuple[Values, Values]:
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


def interpolate_by_visibility(
    corners: TriangleCorners, visibility: tuple[Values, Values], lit_colors: Interpolate
) -> Values:
    """Colours (count, channels, pixels) by the rule of thesis 5.3.

    The corner seen least counts as in shadow, the one seen most as lit. The third is taken once as lit and once as in
    shadow, and both are mixed by how near it is to those two. Each time the colour goes from that of the corners in
    shadow to that of those lit, over the visibility between them; at a corner it is that corner's. The more the corners
    differ, the more this counts; where they are seen alike, plain interpolation does.

    Args:
        corners: the triangles.
        visibility: see `visibility_map`.
        lit_colors: how the colours of lit corners are interpolated.
    """
    seen, here = visibility
    order = np.argsort(seen, axis=1, kind="stable")
    rank = np.argsort(order, axis=1)
    least, middle, most = np.take_along_axis(seen, order, axis=1).transpose(1, 0, 2)
    as_lit = _share(middle, least, most)
    stepped = np.zeros_like(corners.colors[:, 0])
    for first_lit, low, high, weight in ((1, least, middle, as_lit), (2, middle, most, 1 - as_lit)):
        is_lit = rank >= first_lit
        lit = lit_colors(_only(corners.weights, is_lit), corners)
        dark = barycentric_mix(_only(corners.weights, ~is_lit), corners.colors)
        stepped += weight[:, None] * (dark + _share(here, low, high)[:, None] * (lit - dark))
    plain = barycentric_mix(corners.weights, corners.colors)
    return np.asarray(plain + (most - least)[:, None] * (stepped - plain))


def _share(value: Values, low: Values, high: Values) -> Values:
    """Where between two others a value lies: 0 at the lower or below, 1 at the higher or above; 1 where they agree."""
    span = high - low
    return np.where(span > 0, np.clip((value - low) / np.maximum(span, 1e-6), 0, 1), np.float32(1)).astype(np.float32)


def _only(weights: Values, chosen: NDArray[np.bool_]) -> Values:
    """Weights (count, 3, pixels) of the chosen corners alone, made to sum to 1; equal ones where all theirs are 0."""
    kept = weights * chosen + np.float32(1e-7) * chosen
    return np.asarray(kept / kept.sum(axis=1, keepdims=True))


GRAZING_COSINE = 0.05
"""Cosine below which what comes from around outweighs the light itself: it counts as indirect the more, the lower."""


@dataclass(frozen=True)
class LightAdaptation:
    """Colours are divided by their light's cosine factor, interpolated, and multiplied by the direction's own."""

    def build(self, samples: Samples) -> TriangleField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        return TriangleField(samples, self.mix)

    def mix(self, corners: TriangleCorners) -> Values:
        """See `triangles.Mix`."""
        return interpolate_with_adaptation(np.broadcast_to(corners.weights, corners.cosines[0].shape), corners)


def interpolate_with_adaptation(weights: Values, corners: TriangleCorners) -> Values:
    """Colours (count, channels, pixels) by Eq. 5.1 to 5.3, which are one formula.

    Corners behind the surface (a cosine factor of 0 or less) have indirect light only: c_ind, interpolated, of weight
    w_ind. It is taken from the others before their direct light is scaled, and faded back in:

        c_p = Σ w_i (c_i − w_ind c_ind) δ_p / δ_i + (1 − w_ind) w_ind c_ind + w_ind c_ind

    summed over the corners before the surface. Here c_ind is divided by its weight, without which Eq. 5.2 darkens a
    constant field; differences and δ_p are not let below 0; a corner changes sides gradually, below `GRAZING_COSINE`,
    which
    also bounds 1 / δ_i. At a corner the colour is that corner's.

    Args:
        weights: (count, 3, pixels) barycentric.
        corners: the triangles.
    """
    at_corners, here = corners.cosines
    direct = np.clip(at_corners / GRAZING_COSINE, 0, 1)
    indirect_weights = weights * (1 - direct)
    total = indirect_weights.sum(axis=1)[:, None]
    indirect = barycentric_mix(indirect_weights, corners.colors)
    scale = weights * direct * np.maximum(here, 0)[:, None] / np.maximum(at_corners, 1e-6)
    scaled = barycentric_mix(scale, np.maximum(corners.colors - indirect[:, None], 0))
    return np.asarray(scaled + (2 - total) * indirect, np.float32)


@dataclass(frozen=True)
class ThesisMethod:
    """All of chapter 5 together.

    Adaptation is for the colours of lit corners where visibility differs: where it does not, 5.3 has regular
    interpolation, and there skin, which is no Lambert surface, is better off without (by 1 to 3 dB on real faces).
    Its normalisation (5.5) is the sum over light maps, which weighs every texel by its solid angle: a field holds none.
    Triangles that reach to the ring are interpolated linearly, as in 5.6.
    """

    def build(self, samples: Samples) -> TriangleField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        captured = len(samples.directions)
        known = replace(samples, known_geometry=samples.geometry)

        def mix(corners: TriangleCorners) -> Values:
            colors = barycentric_mix(corners.weights, corners.colors)
            inside = np.all(corners.triangles < captured, axis=1)
            colors[inside] = self.mix(corners.only(inside))
            return colors

        return TriangleField(with_black_ring(known), mix)

    def mix(self, corners: TriangleCorners) -> Values:
        """See `triangles.Mix`; between captured lights."""
        return interpolate_by_visibility(corners, visibility_map(corners, smooth=True), interpolate_with_adaptation)
