"""Polynomial texture maps (thesis 4.1; Malzbender, Gelb and Wolters 2001)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import LightsError
from relit_camera.reflectance.black_ring import region_share
from relit_camera.reflectance.method import factored_field
from relit_camera.reflectance.samples import Samples
from relit_camera.subject.field import FactoredField

COEFFICIENTS = 6


@dataclass(frozen=True)
class PolynomialTextureMap:
    """Each pixel and channel is a quadratic polynomial of the light's x and y, fitted by least squares.

    x and y tell only lights before the subject apart, so those behind are left out, and beyond the sampled region the
    field fades as over the thesis's black ring.
    """

    def build(self, samples: Samples) -> FactoredField:
        """The field; see `Method.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        front = np.flatnonzero(directions[:, 2] > 0)
        known = _terms(directions[front])
        if np.linalg.matrix_rank(known) < COEFFICIENTS:
            raise LightsError(
                f"{len(front)} of {len(directions)} lights before the subject carry no polynomial of two variables",
                f"at least {COEFFICIENTS}, not all on one conic, are needed",
            )
        weights = np.zeros((len(directions), len(queries)), np.float32)
        share = region_share(directions[front], queries) * (queries[:, 2] > 0)
        weights[front] = np.linalg.pinv(known).T @ _terms(queries).T * share
        return weights


def _terms(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """1, x, y, x², xy, y² (count, 6) of unit vectors (count, 3)."""
    x, y, _ = directions.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
