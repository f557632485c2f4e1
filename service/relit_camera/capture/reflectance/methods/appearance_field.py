"""The method `model`: the appearance model fitted to each pixel, plus its residual interpolated over directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from relit_camera.base.array_types import Float32Array
from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.capture.reflectance.appearance_model import (
    SPECULAR_TERMS,
    TERM_COUNT,
    SpecularEstimate,
    direct_light_fractions,
    distant_terms,
    fit_appearance,
    specular_prior,
)
from relit_camera.capture.reflectance.methods.gaussian_process import Kernel
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import region_coverage
from relit_camera.subject.reflectance_field import texel_vectors

FIT_BLOCK = 512
"""Pixels fitted at a time: 2 MB of terms for 200 lights."""
QUERY_BLOCK = 1 << 17
"""Pairs of a pixel and a direction evaluated at a time: half a megabyte a term, which stays in the cache."""
KERNEL_CANDIDATES = [
    Kernel(float(np.radians(reach)), noise) for reach in (10, 15, 20, 30, 45, 70) for noise in (0.03, 0.1, 0.3, 1.0)
]


@dataclass(frozen=True)
class ResidualTunables:
    """Interpolation of the residual; `relit evaluate olat` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        validation_pixels: number of pixels by which cross-validation chooses the residual's kernel.
        folds: parts of the cross-validation.
        short_reach_rad: reach of the second kernel, for what is true of one light's own direction only.
        max_compensation: largest factor that makes up for captured lights on the other side of a shadow's edge. Where
            less than half of the weight lies on the pixel's own side, the residual is predicted too small rather than
            extrapolated.
        picture_noise_variance: variance of the pictures' own noise, in units of the residual's variance.
    """

    validation_pixels: int = 4096
    folds: int = 5
    short_reach_rad: float = float(np.radians(4.0))
    max_compensation: float = 2.0
    picture_noise_variance: float = 0.01


RESIDUAL = ResidualTunables()


@dataclass(frozen=True)
class AppearanceMethod:
    """The appearance model plus a Gaussian process for its residual.

    The appearance model extrapolates beyond the sampled region; the residual has mean 0 and fades to 0 there.
    """

    def build(self, samples: OlatSamples) -> AppearanceField:
        """The field; see `ReflectanceMethod.build`. It uses `samples.geometry`."""
        region_coverage(samples.directions, samples.directions[:1])
        inside = np.flatnonzero(samples.matte.ravel() > 0)
        validation = inside[:: max(1, len(inside) // RESIDUAL.validation_pixels)]
        specular = specular_prior(_fit(samples, inside)[1], inside, samples.matte)
        return AppearanceField(samples, _fit(samples, inside, specular)[0], choose_kernel(samples, validation))


@dataclass(frozen=True)
class AppearanceField:
    """The field that `AppearanceMethod` builds.

    Attributes:
        samples: the captured lights.
        amounts: (pixels, 3, TERM_COUNT) of the appearance model's terms.
        kernel: covariance of the residual over directions.
    """

    samples: OlatSamples
    amounts: Float32Array
    kernel: Kernel

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.samples.pictures.shape[1], self.samples.pictures.shape[2]

    def dense(self, start: int, stop: int) -> Float32Array:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        return self._evaluate(texel_vectors(), self._texel_weights, np.arange(start, stop)).transpose(0, 2, 1)

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        weights = residual_weights(self.kernel, self.samples.directions, directions)
        return self._evaluate(directions, weights, pixels).transpose(2, 0, 1)

    @cached_property
    def _texel_weights(self) -> Float32Array:
        return residual_weights(self.kernel, self.samples.directions, texel_vectors())

    def fitted_to(self, samples: OlatSamples, pixels: NDArray[np.intp]) -> AppearanceField:
        """A field with the same kernel, fitted to other samples of this person at these row-major pixels only."""
        return AppearanceField(samples, _fit(samples, pixels)[0], self.kernel)

    def appearance_at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        """R as `at` gives it, of the appearance model alone, without the residual."""
        return _modelled(self.samples, self.amounts, directions, pixels).transpose(2, 0, 1)

    def _evaluate(
        self, directions: NDArray[np.float64], weights: Float32Array, pixels: NDArray[np.intp]
    ) -> Float32Array:
        """R as (pixels, 3, count), given the weights (lights, count) that predict the residual."""
        result = np.empty((len(pixels), 3, len(directions)), np.float32)
        step = max(1, QUERY_BLOCK // max(1, len(directions)))
        for start in range(0, len(pixels), step):
            block = pixels[start : start + step]
            found = _modelled(self.samples, self.amounts, directions, block)
            found += self._residual(directions, weights, block)
            # The terms are not negative, and no light takes light away.
            np.maximum(found, 0, out=result[start : start + step])
        return result

    def _residual(
        self, directions: NDArray[np.float64], weights: Float32Array, pixels: NDArray[np.intp]
    ) -> Float32Array:
        """The predicted residual (pixels, 3, count): for lit queries from lights that reach the pixel, else the rest.

        The model's error in direct light says nothing about its error in shadow, and the other way round.
        """
        geometry = self.samples.geometry
        residual = appearance_residual(self.samples, self.amounts, pixels)
        lit = direct_light_fractions(geometry, self.samples.directions, pixels)
        query_lit = direct_light_fractions(geometry, directions, pixels)[:, None]
        in_light, in_shadow = (_predicted_residual(weights, fraction, residual) for fraction in (lit, 1 - lit))
        return np.asarray(query_lit * in_light + (1 - query_lit) * in_shadow)


def _predicted_residual(weights: Float32Array, fractions: Float32Array, residual: Float32Array) -> Float32Array:
    """Residuals (pixels, 3, count) predicted from captured ones (pixels, 3, lights), each counted by its fraction.

    The weights (lights, count) are rescaled, by `ResidualTunables.max_compensation` at most, so that those counted by
    their fractions (pixels, lights) have the sum of all.
    """
    counted = fractions @ weights
    factor = np.clip(weights.sum(axis=0) / np.maximum(counted, 1e-3), 0, RESIDUAL.max_compensation)
    predicted = (fractions[:, None] * residual).reshape(-1, len(weights)) @ weights
    return np.asarray(predicted.reshape(*residual.shape[:2], -1) * factor[:, None])


def _fit(
    samples: OlatSamples, pixels: NDArray[np.intp], expected: SpecularEstimate | None = None
) -> tuple[Float32Array, SpecularEstimate]:
    """Amounts (height · width, 3, TERM_COUNT), 0 but at the given pixels, and the specular estimate of those pixels."""
    geometry, bright = samples.geometry, _bright(samples)
    amounts = np.zeros((samples.matte.size, 3, TERM_COUNT), np.float32)
    specular = SpecularEstimate(*np.zeros((2, len(pixels), len(SPECULAR_TERMS)), np.float32))

    def fit(start: int) -> None:
        part = slice(start, start + FIT_BLOCK)
        block = pixels[part]
        terms = distant_terms(geometry, samples.directions, block)
        prior = None if expected is None else SpecularEstimate(expected.amounts[part], expected.precision[part])
        amounts[block], found = fit_appearance(terms, _values(samples, block), bright, prior)
        specular.amounts[part], specular.precision[part] = found.amounts, found.precision

    with worker_pool() as pool:
        # Consuming the results raises what a worker raised.
        list(pool.map(fit, range(0, len(pixels), FIT_BLOCK)))
    return amounts, specular


def _values(samples: OlatSamples, pixels: NDArray[np.intp]) -> Float32Array:
    """Captured values (pixels, 3, lights) of row-major pixels."""
    pictures = samples.pictures.reshape(len(samples.directions), -1, 3)
    return np.ascontiguousarray(pictures[:, pixels].transpose(1, 2, 0))


def _bright(samples: OlatSamples) -> float:
    """The 99th percentile of the person's values: the level that counts as bright."""
    inside = np.flatnonzero(samples.matte.ravel() > 0.5)
    some = inside[:: max(1, len(inside) // RESIDUAL.validation_pixels)]
    return float(np.percentile(samples.pictures.reshape(len(samples.directions), -1, 3)[:, some], 99))


def _modelled(
    samples: OlatSamples, amounts: Float32Array, directions: NDArray[np.float64], pixels: NDArray[np.intp]
) -> Float32Array:
    """The appearance (pixels, 3, count) of row-major pixels under unit vectors (count, 3)."""
    return np.asarray(amounts[pixels] @ distant_terms(samples.geometry, directions, pixels))


def appearance_residual(samples: OlatSamples, amounts: Float32Array, pixels: NDArray[np.intp]) -> Float32Array:
    """Captured values minus those of the appearance model at row-major pixels: (pixels, 3, lights)."""
    return np.asarray(_values(samples, pixels) - _modelled(samples, amounts, samples.directions, pixels))


def residual_weights(kernel: Kernel, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> Float32Array:
    """Weights (lights, queries) of simple kriging with mean 0: they fall to 0 away from every light.

    What other lights do not explain is mostly no noise but true of its own direction and changes within a few degrees,
    as a shadow's edge does. So it is modelled as a second process of short reach, and a captured light returns nearly
    its own picture (a nugget of micro-scale variation; Cressie 1993, 2.3.1).
    """
    near = Kernel(RESIDUAL.short_reach_rad, 0)

    def covariance(others: NDArray[np.float64]) -> NDArray[np.float64]:
        return kernel.covariance(directions, others) + kernel.noise * near.covariance(directions, others)

    known = covariance(directions) + RESIDUAL.picture_noise_variance * np.eye(len(directions))
    return np.asarray(cho_solve(cho_factor(known), covariance(queries)), np.float32)


def choose_kernel(samples: OlatSamples, pixels: NDArray[np.intp]) -> Kernel:
    """The candidate kernel that best predicts lights left out of both the appearance fit and the residual.

    Cross-validation in parts (`ResidualTunables.folds`), of one light at least, over row-major pixels. The appearance
    model is fitted anew for each part, because its residual is smaller and rougher for lights that it was fitted to.
    The geometry is that of all lights, so those left out are not wholly unseen, and the fit is without the specular
    prior.
    """
    lights = len(samples.directions)
    folds = min(RESIDUAL.folds, lights)
    values = _values(samples, pixels)
    terms = distant_terms(samples.geometry, samples.directions, pixels)
    bright = _bright(samples)

    def errors_of(fold: int) -> list[float]:
        """Sum of squared errors of each candidate for the lights of one part."""
        left_out = np.arange(lights) % folds == fold
        amounts, _ = fit_appearance(terms[..., ~left_out], values[..., ~left_out], bright)
        residual = values - amounts @ terms
        known, queries = samples.directions[~left_out], samples.directions[left_out]
        fitted, truth = (residual[..., part].reshape(-1, part.sum()) for part in (~left_out, left_out))
        predicted = (fitted @ residual_weights(kernel, known, queries) for kernel in KERNEL_CANDIDATES)
        return [float(np.sum((truth - each) ** 2)) for each in predicted]

    with worker_pool() as pool:
        errors = np.sum(list(pool.map(errors_of, range(folds))), axis=0)
    return KERNEL_CANDIDATES[int(errors.argmin())]
