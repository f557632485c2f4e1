"""The nearest captured light: the baseline under all others.

Polynomial texture maps (thesis 4.1; Malzbender, Gelb and Wolters 2001).

Spherical harmonics of each pixel's reflectance map: smooth, and no shadow has an edge.

Radial basis functions over directions: smooth, and nearly exact at the captured ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from relit_camera.base.errors import LightsError
from relit_camera.capture.reflectance.method_registry import factored_field
from relit_camera.capture.reflectance.sampled_region import region_coverage
from relit_camera.capture.reflectance.samples import Samples
from relit_camera.light.spherical_harmonics import basis
from relit_camera.subject.reflectance_field import FactoredField

MAX_DISTANCE_DEG = 60.0


@dataclass(frozen=True)
class Nearest:
    """Each direction shows the captured light nearest to it, none farther than `max_distance_deg`."""

    max_distance_deg: float = MAX_DISTANCE_DEG

    def build(self, samples: Samples) -> FactoredField:
        """The field; see `Method.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        cosine = queries @ directions.T
        chosen = cosine.argmax(axis=1)
        near = cosine[np.arange(len(queries)), chosen] >= np.cos(np.radians(self.max_distance_deg))
        weights = np.zeros((len(directions), len(queries)), dtype=np.float32)
        weights[chosen[near], np.flatnonzero(near)] = 1
        return weights


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
        share = region_coverage(directions[front], queries) * (queries[:, 2] > 0)
        weights[front] = np.linalg.pinv(known).T @ _terms(queries).T * share
        return weights


def _terms(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """1, x, y, x², xy, y² (count, 6) of unit vectors (count, 3)."""
    x, y, _ = directions.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)


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
        asked = basis(queries, self.degree) * region_coverage(directions, queries)[:, None]
        return np.asarray(fit.T @ asked.T, np.float32)


SMOOTHING = 1e-4
"""A thousandth of the kernel between lights 15° apart: pictures of nearly one direction are averaged, not resolved."""


@dataclass(frozen=True)
class RadialBasis:
    """Thin-plate splines of the distance between unit vectors, with a linear polynomial.

    The light's cosine with a normal is such a polynomial, and so is reproduced. Beyond the sampled region it fades as
    over the thesis's black ring.
    """

    def build(self, samples: Samples) -> FactoredField:
        """The field; see `Method.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        share = region_coverage(directions, queries)
        one_by_one = np.eye(len(directions))
        spline = RBFInterpolator(directions, one_by_one, smoothing=SMOOTHING, kernel="thin_plate_spline", degree=1)
        return np.asarray((spline(queries) * share[:, None]).T, np.float32)
