"""Interpolation that knows how squarely light falls on the skin: light adaptation (thesis 5.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.reflectance.samples import Samples
from relit_camera.reflectance.triangles import Corners, TriangleField, Values, barycentric

GRAZING = 0.05
"""Cosine below which what comes from around outweighs the light itself: it counts as indirect the more, the lower."""


@dataclass(frozen=True)
class Adaptation:
    """Colours are divided by their light's cosine factor, interpolated, and multiplied by the direction's own."""

    def build(self, samples: Samples) -> TriangleField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        return TriangleField(samples, self.mix)

    def mix(self, corners: Corners) -> Values:
        """See `triangles.Mix`."""
        return adapted(np.broadcast_to(corners.weights, corners.cosines[0].shape), corners)


def adapted(weights: Values, corners: Corners) -> Values:
    """Colours (count, channels, pixels) by Eq. 5.1 to 5.3, which are one formula.

    Corners behind the surface (a cosine factor of 0 or less) have indirect light only: c_ind, interpolated, of weight
    w_ind. It is taken from the others before their direct light is scaled, and faded back in:

        c_p = Σ w_i (c_i − w_ind c_ind) δ_p / δ_i + (1 − w_ind) w_ind c_ind + w_ind c_ind

    summed over the corners before the surface. Here c_ind is divided by its weight, without which Eq. 5.2 darkens a
    constant field; differences and δ_p are not let below 0; a corner changes sides gradually, below `GRAZING`, which
    also bounds 1 / δ_i. At a corner the colour is that corner's.

    Args:
        weights: (count, 3, pixels) barycentric.
        corners: the triangles.
    """
    at_corners, here = corners.cosines
    direct = np.clip(at_corners / GRAZING, 0, 1)
    indirect_weights = weights * (1 - direct)
    total = indirect_weights.sum(axis=1)[:, None]
    indirect = barycentric(indirect_weights, corners.colours)
    scale = weights * direct * np.maximum(here, 0)[:, None] / np.maximum(at_corners, 1e-6)
    scaled = barycentric(scale, np.maximum(corners.colours - indirect[:, None], 0))
    return np.asarray(scaled + (2 - total) * indirect, np.float32)
