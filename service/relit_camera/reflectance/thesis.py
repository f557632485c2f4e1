"""The thesis's final method: smoothed visibility, light adaptation, the black ring (5.3 to 5.6)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relit_camera.reflectance.adaptation import adapted
from relit_camera.reflectance.black_ring import with_black_ring
from relit_camera.reflectance.samples import Samples
from relit_camera.reflectance.triangles import Corners, TriangleField, Values, barycentric
from relit_camera.reflectance.visibility import by_visibility, visibility_map


@dataclass(frozen=True)
class Thesis:
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

        def mix(corners: Corners) -> Values:
            colours = barycentric(corners.weights, corners.colours)
            inside = np.all(corners.triangles < captured, axis=1)
            colours[inside] = self.mix(corners.only(inside))
            return colours

        return TriangleField(with_black_ring(known), mix)

    def mix(self, corners: Corners) -> Values:
        """See `triangles.Mix`; between captured lights."""
        return by_visibility(corners, visibility_map(corners, smooth=True), adapted)
