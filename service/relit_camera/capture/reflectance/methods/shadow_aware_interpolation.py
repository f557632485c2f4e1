"""Shadow-aware interpolation between the three captured lights around a direction, by the person's geometry.

- `VisibilityInterpolation` moves a shadow's edge continuously between lights, by visibility maps (thesis 5.3).
- `LightAdaptation` interpolates colors divided by the cosine of light and normal (thesis 5.4).
- `ThesisMethod` combines both with the black ring: the thesis's final method (5.3 to 5.6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import with_black_ring
from relit_camera.capture.reflectance.triangle_field import TriangleField, TriangleVertices, Values, barycentric_mix
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, direction_from_spherical, spherical_from_direction

Interpolate = Callable[[Values, TriangleVertices], Values]
"""A function of weights (count, 3, pixels) of the lit corners that gives colors (count, channels, pixels)."""
GRAZING_COSINE = 0.05
"""Cosine of light and normal below which indirect light prevails: from here down to 0 a growing part of a corner's
light counts as indirect."""


@dataclass(frozen=True)
class VisibilityInterpolation:
    """Method `visibility`: where some corners are in shadow, the color changes across the shadow's edge.

    The visibility map is smoothed by a 3 × 3 box of texels; where `smooth` is False it is 0 or 1.
    """

    smooth: bool = True

    def build(self, samples: OlatSamples) -> TriangleField:
        """The field; see `ReflectanceMethod.build`. It uses `samples.geometry`."""
        return TriangleField(samples, self.mix)

    def mix(self, corners: TriangleVertices) -> Values:
        """See `triangle_field.VertexMix`."""
        return interpolate_by_visibility(
            corners, visibility_map(corners, self.smooth), lambda w, c: barycentric_mix(w, c.colors)
        )


@dataclass(frozen=True)
class SharpVisibilityInterpolation(VisibilityInterpolation):
    """Method `visibility-sharp`: visibility is 0 or 1, so shadows have hard edges, true only if the geometry is."""

    smooth: bool = False


def visibility_map(corners: TriangleVertices, smooth: bool) -> tuple[Values, Values]:
    """Visibility 0..1 of lights from pixels: at the corners (count, 3, pixels) and at the queries (count, pixels)."""

    def visibility(directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Values:
        if smooth:
            return smoothed_visibility(corners.geometry, directions, pixels)
        return corners.geometry.visible(directions, pixels).astype(np.float32)

    return corners.around(visibility)


def smoothed_visibility(geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Values:
    """Visibility (pixels, count) of unit vectors (count, 3), through a 3 × 3 box filter.

    The mean over nine directions, spaced like texels of the light map, around each.
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
    corners: TriangleVertices, visibility: tuple[Values, Values], lit_colors: Interpolate
) -> Values:
    """Colors (count, channels, pixels) by the rule of thesis 5.3.

    The least visible corner counts as in shadow, the most visible one as lit. The third counts once as lit and once as
    in shadow, and both results are mixed by how near its visibility is to those two. Each time the color goes from that
    of the corners in shadow to that of the lit ones with the query's visibility; at a corner it is that corner's. The
    result is mixed with plain interpolation by the difference in visibility between the corners.

    Args:
        corners: the triangles.
        visibility: see `visibility_map`.
        lit_colors: interpolates the colors of the lit corners.
    """
    at_corners, at_query = visibility
    order = np.argsort(at_corners, axis=1, kind="stable")
    rank = np.argsort(order, axis=1)
    least, middle, most = np.take_along_axis(at_corners, order, axis=1).transpose(1, 0, 2)
    as_lit = _interpolation_fraction(middle, least, most)
    stepped = np.zeros_like(corners.colors[:, 0])
    for first_lit, low, high, weight in ((1, least, middle, as_lit), (2, middle, most, 1 - as_lit)):
        is_lit = rank >= first_lit
        lit = lit_colors(_only(corners.weights, is_lit), corners)
        dark = barycentric_mix(_only(corners.weights, ~is_lit), corners.colors)
        stepped += weight[:, None] * (dark + _interpolation_fraction(at_query, low, high)[:, None] * (lit - dark))
    plain = barycentric_mix(corners.weights, corners.colors)
    return np.asarray(plain + (most - least)[:, None] * (stepped - plain))


def _interpolation_fraction(value: Values, low: Values, high: Values) -> Values:
    """Position of `value` between two others: 0 at `low` or below, 1 at `high` or above, and 1 where both are equal."""
    span = high - low
    return np.where(span > 0, np.clip((value - low) / np.maximum(span, 1e-6), 0, 1), np.float32(1)).astype(np.float32)


def _only(weights: Values, chosen: NDArray[np.bool_]) -> Values:
    """Weights (count, 3, pixels) of the chosen corners alone, normalized to sum 1; equal weights where all are 0."""
    kept = weights * chosen + np.float32(1e-7) * chosen
    return np.asarray(kept / kept.sum(axis=1, keepdims=True))


@dataclass(frozen=True)
class LightAdaptation:
    """Method `adaptation`: colors divided by their light's cosine are interpolated, then times the query's."""

    def build(self, samples: OlatSamples) -> TriangleField:
        """The field; see `ReflectanceMethod.build`. It uses `samples.geometry`."""
        return TriangleField(samples, self.mix)

    def mix(self, corners: TriangleVertices) -> Values:
        """See `triangle_field.VertexMix`."""
        return interpolate_with_adaptation(np.broadcast_to(corners.weights, corners.cosines[0].shape), corners)


def interpolate_with_adaptation(weights: Values, corners: TriangleVertices) -> Values:
    """Colors (count, channels, pixels) by Eq. 5.1 to 5.3 of the thesis, which are one formula.

    Corners behind the surface (a cosine factor of 0 or less) have indirect light only: c_ind, interpolated, of weight
    w_ind. It is taken from the others before their direct light is scaled, and faded back in:

        c_p = Σ w_i (c_i − w_ind c_ind) δ_p / δ_i + (1 − w_ind) w_ind c_ind + w_ind c_ind

    summed over the corners before the surface. Here c_ind is divided by its weight, without which Eq. 5.2 darkens a
    constant field; differences and δ_p are clamped at 0; a corner changes from direct to indirect gradually, below
    `GRAZING_COSINE`, which also bounds 1 / δ_i. At a corner the color is that corner's.

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
    """Method `thesis`: all of chapter 5 together.

    Adaptation applies to lit corners where visibility differs. Where it does not, 5.3 interpolates plainly, which suits
    skin, no Lambert surface, better (by 1 to 3 dB on real faces). The normalization (5.5) is no part of a field: sums
    over light maps weight every texel by its solid angle. Triangles that reach to the ring are interpolated linearly,
    as in 5.6.
    """

    def build(self, samples: OlatSamples) -> TriangleField:
        """The field; see `ReflectanceMethod.build`. It uses `samples.geometry`."""
        captured = len(samples.directions)
        known = replace(samples, known_geometry=samples.geometry)

        def mix(corners: TriangleVertices) -> Values:
            colors = barycentric_mix(corners.weights, corners.colors)
            inside = np.all(corners.triangles < captured, axis=1)
            colors[inside] = self.mix(corners.subset(inside))
            return colors

        return TriangleField(with_black_ring(known), mix)

    def mix(self, corners: TriangleVertices) -> Values:
        """See `triangle_field.VertexMix`; between captured lights."""
        return interpolate_by_visibility(corners, visibility_map(corners, smooth=True), interpolate_with_adaptation)
