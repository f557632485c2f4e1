"""The method `gp`: a Gaussian process over directions, its kernel fitted to the pictures by maximum likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, null_space
from scipy.optimize import minimize

from relit_camera.capture.reflectance.method_registry import factored_field
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import region_coverage
from relit_camera.subject.reflectance_field import FactoredField

Values = NDArray[np.float64]

START_LENGTH_SCALE, START_NOISE = np.radians(40.0), 1e-2
"""Where the search for the kernel's parameters starts; the bounds below limit it."""
LENGTH_SCALE_BOUNDS = np.radians([3.0, 360.0])
NOISE_BOUNDS = (1e-6, 1.0)


@dataclass(frozen=True)
class GaussianProcess:
    """One kernel for all pixels, its parameters those of the largest pooled marginal likelihood."""

    def build(self, samples: OlatSamples) -> FactoredField:
        """The field; see `ReflectanceMethod.build`."""
        return factored_field(fit_kernel(samples), samples)


@dataclass(frozen=True)
class Kernel:
    """Covariance of a pixel's values under two lights, and the prediction by it (universal kriging; Matheron 1969).

    Matérn with smoothness 3/2 over the distance of unit vectors, about a mean that is linear in the direction, as
    Lambert's law is. Beyond the sampled region the prediction fades over the black ring (`sampled_region`).

    Attributes:
        length_scale: as the distance of unit vectors.
        noise: variance that no other light explains (the nugget), in units of the process's variance.
    """

    length_scale: float
    noise: float

    def covariance(self, first: Values, second: Values) -> Values:
        """Covariance (count, others) of unit vectors (count, 3) and (others, 3), 1 at no distance."""
        distance = np.sqrt(np.maximum(2 - 2 * first @ second.T, 0)) * (np.sqrt(3) / self.length_scale)
        return np.asarray((1 + distance) * np.exp(-distance))

    def weights(self, directions: Values, queries: Values) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        fraction = region_coverage(directions, queries)
        factor = cho_factor(self.covariance(directions, directions) + self.noise * np.eye(len(directions)))
        trend, query_trend = _trend(directions), _trend(queries)
        known = cho_solve(factor, self.covariance(directions, queries))
        # The correction for the mean, which is estimated too.
        solved = cho_solve(factor, trend)
        correction = np.linalg.lstsq(trend.T @ solved, query_trend.T - trend.T @ known, rcond=None)[0]
        return np.asarray((known + solved @ correction) * fraction, np.float32)


def fit_kernel(samples: OlatSamples) -> Kernel:
    """The kernel under which the pictures inside the matte are likeliest, whatever their mean (REML; Harville 1974).

    All pixels and channels count as independent draws of one process, so only the pictures' inner products matter.

    Raises:
        LightsError: the directions span no region.
    """
    region_coverage(samples.directions, samples.directions[:1])
    lights = len(samples.directions)
    inside = np.flatnonzero(samples.matte.ravel() > 0.5)
    values = samples.pictures.reshape(lights, -1, 3)[:, inside].reshape(lights, -1)
    contrasts = null_space(_trend(samples.directions).T)
    products = contrasts.T @ (values @ values.T).astype(np.float64) @ contrasts / values.shape[1]

    def negative_log_likelihood(logarithms: Values) -> float:
        length_scale, noise = np.exp(logarithms)
        covariance = Kernel(length_scale, noise).covariance(samples.directions, samples.directions)
        contrast_covariance = contrasts.T @ (covariance + noise * np.eye(lights)) @ contrasts
        factor = cho_factor(contrast_covariance)
        # The variance that maximizes the likelihood, given the two other parameters.
        variance = np.trace(cho_solve(factor, products)) / len(products)
        return float(2 * np.log(np.diag(factor[0])).sum() + len(products) * np.log(max(variance, 1e-300)))

    bounds = [tuple(np.log(LENGTH_SCALE_BOUNDS)), tuple(np.log(NOISE_BOUNDS))]
    found = minimize(
        negative_log_likelihood, np.log([START_LENGTH_SCALE, START_NOISE]), method="Nelder-Mead", bounds=bounds
    )
    length_scale, noise = np.exp(found.x)
    return Kernel(float(length_scale), float(noise))


def _trend(directions: Values) -> Values:
    """Linear trend: columns 1, x, y, z (count, 4) of unit vectors (count, 3)."""
    return np.column_stack([np.ones(len(directions)), directions])
