"""Spherical harmonics of each pixel's reflectance map: smooth, and no shadow has an edge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.harmonics import basis
from relit_camera.reflectance.black_ring import region_share
from relit_camera.reflectance.method import factored_field
from relit_camera.reflectance.samples import Samples
from relit_camera.subject.field import FactoredField

SMOOTHNESS = 1e-5
"""Weight of a map's roughness against its mean squared misfit: it holds what no light tells, behind the subject."""


@dataclass(frozen=True)
class SphericalHarmonics:
    """Real harmonics up to `degree`, fitted by least squares with the squared Laplacian as roughness.

    Beyond the sampled region, of which the fit knows nothing, it fades as over the thesis's black ring.
    """

    degree: int = 3

    def build(self, samples: Samples) -> FactoredField:
        """The field; see `Method.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        known = basis(directions, self.degree)
        order = np.floor(np.sqrt(np.arange(known.shape[1])))
        roughness = SMOOTHNESS * (order * (order + 1)) ** 2
        fit = np.linalg.solve(known.T @ known / len(known) + np.diag(roughness), known.T / len(known))
        asked = basis(queries, self.degree) * region_share(directions, queries)[:, None]
        return np.asarray(fit.T @ asked.T, np.float32)
