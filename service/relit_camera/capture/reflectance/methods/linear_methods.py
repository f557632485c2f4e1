"""Linear methods: a picture under any light is a weighted sum of the captured ones, the same weights for all pixels.

- `Nearest`: the nearest captured light, the baseline.
- `PolynomialTextureMap`: a quadratic polynomial of the light's x and y.
- `SphericalHarmonics`: real harmonics up to a degree; smooth, so shadows have no edges.
- `RadialBasis`: thin-plate splines over directions; smooth, and nearly exact at the captured ones.

All but the first are fitted, know nothing beyond the sampled region, and fade to black over the black ring around it
(`sampled_region`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from relit_camera.base.errors import LightsError
from relit_camera.capture.reflectance.method_registry import factored_field
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import region_coverage
from relit_camera.light.spherical_harmonics import basis
from relit_camera.subject.reflectance_field import FactoredField

MAX_DISTANCE_DEG = 60.0
"""Distance from every captured light beyond which `Nearest` is black."""
POLYNOMIAL_TERMS = 6
HARMONICS_ROUGHNESS = 1e-5
"""Weight of the mean squared Laplacian against the mean squared misfit: it keeps the harmonics small where no light
constrains them, behind the subject."""
SPLINE_SMOOTHING = 1e-4
"""A thousandth of the kernel between lights 15° apart: pictures of nearly equal directions are averaged."""


@dataclass(frozen=True)
class Nearest:
    """Each direction shows the captured light nearest to it, none farther than `max_distance_deg`."""

    max_distance_deg: float = MAX_DISTANCE_DEG

    def build(self, samples: OlatSamples) -> FactoredField:
        """The field; see `ReflectanceMethod.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        cosine = queries @ directions.T
        chosen = cosine.argmax(axis=1)
        near = cosine[np.arange(len(queries)), chosen] >= np.cos(np.radians(self.max_distance_deg))
        weights = np.zeros((len(directions), len(queries)), dtype=np.float32)
        weights[chosen[near], np.flatnonzero(near)] = 1
        return weights


@dataclass(frozen=True)
class PolynomialTextureMap:
    """Polynomial texture map (thesis 4.1; Malzbender, Gelb and Wolters 2001): a least-squares quadratic of x and y.

    x and y do not distinguish lights before the subject from those behind, so the latter are left out.
    """

    def build(self, samples: OlatSamples) -> FactoredField:
        """The field; see `ReflectanceMethod.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        front = np.flatnonzero(directions[:, 2] > 0)
        known = _terms(directions[front])
        if np.linalg.matrix_rank(known) < POLYNOMIAL_TERMS:
            raise LightsError(
                f"{len(front)} of {len(directions)} lights before the subject carry no polynomial of two variables",
                f"at least {POLYNOMIAL_TERMS}, not all on one conic, are needed",
            )
        weights = np.zeros((len(directions), len(queries)), np.float32)
        fraction = region_coverage(directions[front], queries) * (queries[:, 2] > 0)
        weights[front] = np.linalg.pinv(known).T @ _terms(queries).T * fraction
        return weights


def _terms(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """1, x, y, x², xy, y² (count, 6) of unit vectors (count, 3)."""
    x, y, _ = directions.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)


@dataclass(frozen=True)
class SphericalHarmonics:
    """Real spherical harmonics up to `degree`, fitted by least squares with the squared Laplacian as regularizer."""

    degree: int = 3

    def build(self, samples: OlatSamples) -> FactoredField:
        """The field; see `ReflectanceMethod.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        fitted = basis(directions, self.degree)
        order = np.floor(np.sqrt(np.arange(fitted.shape[1])))
        penalty = HARMONICS_ROUGHNESS * (order * (order + 1)) ** 2
        fit = np.linalg.solve(fitted.T @ fitted / len(fitted) + np.diag(penalty), fitted.T / len(fitted))
        queried = basis(queries, self.degree) * region_coverage(directions, queries)[:, None]
        return np.asarray(fit.T @ queried.T, np.float32)


@dataclass(frozen=True)
class RadialBasis:
    """Thin-plate splines of the distance between unit vectors, with a linear polynomial.

    The light's cosine with a normal is such a polynomial, so Lambert's law is reproduced.
    """

    def build(self, samples: OlatSamples) -> FactoredField:
        """The field; see `ReflectanceMethod.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        fraction = region_coverage(directions, queries)
        one_hot = np.eye(len(directions))
        spline = RBFInterpolator(directions, one_hot, smoothing=SPLINE_SMOOTHING, kernel="thin_plate_spline", degree=1)
        return np.asarray((spline(queries) * fraction[:, None]).T, np.float32)
