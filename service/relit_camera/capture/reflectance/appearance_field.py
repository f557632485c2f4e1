"""A fitted model of each pixel's appearance, and what it leaves unexplained interpolated over directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from relit_camera.base.threads import worker_pool
from relit_camera.capture.reflectance.appearance_model import (
    SPECULAR_TERMS,
    TERM_COUNT,
    SpecularEstimate,
    direct_light_fractions,
    distant_terms,
    fit_appearance,
    specular_prior,
)
from relit_camera.capture.reflectance.gaussian_process import Kernel
from relit_camera.capture.reflectance.sampled_region import region_coverage
from relit_camera.capture.reflectance.samples import Samples
from relit_camera.subject.reflectance_field import texel_vectors

Floats = NDArray[np.float32]

BLOCK = 512
"""Pixels fitted at a time: 2 MB of terms for 200 lights."""
PAIRS = 1 << 17
"""Of a pixel and a direction, answered at a time: half a megabyte a term, which stays in the cache."""
VALIDATION_PIXELS = 4096
"""Pixels by which the residual's kernel is chosen."""
FOLDS = 5
NEAR_REACH = float(np.radians(4.0))
MAX_COMPENSATION = 2.0
"""With fewer captured lights on a pixel's own side of the shadow than half by weight, less of the residual is known."""
MEASUREMENT = 0.01
"""Variance of the pictures' own noise."""
KERNEL_CANDIDATES = [
    Kernel(float(np.radians(reach)), noise) for reach in (10, 15, 20, 30, 45, 70) for noise in (0.03, 0.1, 0.3, 1.0)
]


@dataclass(frozen=True)
class AppearanceMethod:
    """Appearance plus residual.

    The appearance model reaches beyond the sampled region, where interpolation has nothing to say; the residual, a
    Gaussian process about 0, ends there by itself.
    """

    def build(self, samples: Samples) -> AppearanceField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        region_coverage(samples.directions, samples.directions[:1])
        inside = np.flatnonzero(samples.matte.ravel() > 0)
        judges = inside[:: max(1, len(inside) // VALIDATION_PIXELS)]
        gloss = specular_prior(_fit(samples, inside)[1], inside, samples.matte)
        return AppearanceField(samples, _fit(samples, inside, gloss)[0], choose_kernel(samples, judges))


@dataclass(frozen=True)
class AppearanceField:
    """What `AppearanceMethod` builds.

    Attributes:
        samples: the captured lights.
        amounts: (pixels, 3, TERMS) of the appearance's terms.
        kernel: of the residual over directions.
    """

    samples: Samples
    amounts: Floats
    kernel: Kernel

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.samples.pictures.shape[1], self.samples.pictures.shape[2]

    def dense(self, start: int, stop: int) -> Floats:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        return self._answer(texel_vectors(), self._texel_weights, np.arange(start, stop)).transpose(0, 2, 1)

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        weights = residual_weights(self.kernel, self.samples.directions, directions)
        return self._answer(directions, weights, pixels).transpose(2, 0, 1)

    @cached_property
    def _texel_weights(self) -> Floats:
        return residual_weights(self.kernel, self.samples.directions, texel_vectors())

    def fitted_to(self, samples: Samples, pixels: NDArray[np.intp]) -> AppearanceField:
        """The same model of other samples of this person, fitted at some row-major pixels only."""
        return AppearanceField(samples, _fit(samples, pixels)[0], self.kernel)

    def appearance_at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
        """R as `at`, without the residual."""
        return _modelled(self.samples, self.amounts, directions, pixels).transpose(2, 0, 1)

    def _answer(self, directions: NDArray[np.float64], weights: Floats, pixels: NDArray[np.intp]) -> Floats:
        """(pixels, 3, count), by weights (lights, count) of the residual."""
        result = np.empty((len(pixels), 3, len(directions)), np.float32)
        step = max(1, PAIRS // max(1, len(directions)))
        for start in range(0, len(pixels), step):
            block = pixels[start : start + step]
            found = _modelled(self.samples, self.amounts, directions, block)
            found += self._residual(directions, weights, block)
            # The terms are not negative, and no light takes light away.
            np.maximum(found, 0, out=result[start : start + step])
        return result

    def _residual(self, directions: NDArray[np.float64], weights: Floats, pixels: NDArray[np.intp]) -> Floats:
        """The residual (pixels, 3, count) that the captured lights foretell: lit ones for lit pixels, others for dark.

        What the model is wrong by in the light says nothing of the shadow, and the other way round.
        """
        known, shape = self.samples.directions, self.samples.geometry
        left = appearance_residual(self.samples, self.amounts, pixels)
        lit, asked = (
            direct_light_fractions(shape, known, pixels),
            direct_light_fractions(shape, directions, pixels)[:, None],
        )
        in_light, in_shadow = (_predicted_residual(weights, share, left) for share in (lit, 1 - lit))
        return np.asarray(asked * in_light + (1 - asked) * in_shadow)


def _predicted_residual(weights: Floats, share: Floats, left: Floats) -> Floats:
    """Residuals (pixels, 3, count) by weights (lights, count); captured ones (pixels, 3, lights) count by their share.

    The weights' sum over those that count is made up to the sum of all, within MAX_COMPENSATION.
    """
    counted = share @ weights
    factor = np.clip(weights.sum(axis=0) / np.maximum(counted, 1e-3), 0, MAX_COMPENSATION)
    foretold = (share[:, None] * left).reshape(-1, len(weights)) @ weights
    return np.asarray(foretold.reshape(*left.shape[:2], -1) * factor[:, None])


def _fit(
    samples: Samples, pixels: NDArray[np.intp], expected: SpecularEstimate | None = None
) -> tuple[Floats, SpecularEstimate]:
    """Amounts of all pixels (height · width, 3, TERMS), 0 but at the given ones, and these ones' highlights."""
    geometry, bright = samples.geometry, _bright(samples)
    amounts = np.zeros((samples.matte.size, 3, TERM_COUNT), np.float32)
    gloss = SpecularEstimate(*np.zeros((2, len(pixels), len(SPECULAR_TERMS)), np.float32))

    def fit(start: int) -> None:
        part = slice(start, start + BLOCK)
        block = pixels[part]
        terms = distant_terms(geometry, samples.directions, block)
        hoped = None if expected is None else SpecularEstimate(expected.amounts[part], expected.precision[part])
        amounts[block], found = fit_appearance(terms, _values(samples, block), bright, hoped)
        gloss.amounts[part], gloss.precision[part] = found.amounts, found.precision

    with worker_pool() as pool:
        # Asked for, so that what goes wrong is raised.
        list(pool.map(fit, range(0, len(pixels), BLOCK)))
    return amounts, gloss


def _values(samples: Samples, pixels: NDArray[np.intp]) -> Floats:
    """What row-major pixels show (pixels, 3, lights)."""
    pictures = samples.pictures.reshape(len(samples.directions), -1, 3)
    return np.ascontiguousarray(pictures[:, pixels].transpose(1, 2, 0))


def _bright(samples: Samples) -> float:
    """The 99th percentile of the person's values."""
    inside = np.flatnonzero(samples.matte.ravel() > 0.5)
    some = inside[:: max(1, len(inside) // VALIDATION_PIXELS)]
    return float(np.percentile(samples.pictures.reshape(len(samples.directions), -1, 3)[:, some], 99))


def _modelled(samples: Samples, amounts: Floats, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
    """The appearance (pixels, 3, count) of row-major pixels under unit vectors (count, 3)."""
    return np.asarray(amounts[pixels] @ distant_terms(samples.geometry, directions, pixels))


def appearance_residual(samples: Samples, amounts: Floats, pixels: NDArray[np.intp]) -> Floats:
    """What the appearance leaves of the pictures at row-major pixels: (pixels, 3, lights)."""
    return np.asarray(_values(samples, pixels) - _modelled(samples, amounts, samples.directions, pixels))


def residual_weights(kernel: Kernel, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> Floats:
    """Weights (lights, queries) of a process about 0 (simple kriging): they fall to 0 away from every light.

    What no other light explains is not all noise: most of it is true of its own direction and changes within a few
    degrees, as a shadow's edge does. So it counts as a second process, of short reach, and a captured light returns
    nearly its own picture (a nugget that is micro-scale variation; Cressie 1993, 2.3.1).
    """
    near = Kernel(NEAR_REACH, 0)

    def covariance(others: NDArray[np.float64]) -> NDArray[np.float64]:
        return kernel.covariance(directions, others) + kernel.noise * near.covariance(directions, others)

    known = covariance(directions) + MEASUREMENT * np.eye(len(directions))
    return np.asarray(cho_solve(cho_factor(known), covariance(queries)), np.float32)


def choose_kernel(samples: Samples, pixels: NDArray[np.intp]) -> Kernel:
    """The residual's kernel that foretells lights best which neither it nor the appearance was fitted to.

    Cross-validation in FOLDS parts, of one light at least, over row-major pixels. What the appearance leaves of lights
    that it was fitted to is smaller and rougher than what it leaves of others, so leaving lights out of the residual
    alone misleads. The shape is that of all lights, so those judged are not wholly unseen; and the appearance is fitted
    without what neighbours tell of highlights.
    """
    lights = len(samples.directions)
    folds = min(FOLDS, lights)
    values = _values(samples, pixels)
    terms = distant_terms(samples.geometry, samples.directions, pixels)
    bright = _bright(samples)

    def errors_of(fold: int) -> list[float]:
        """Of each candidate."""
        left_out = np.arange(lights) % folds == fold
        amounts, _ = fit_appearance(terms[..., ~left_out], values[..., ~left_out], bright)
        off = values - amounts @ terms
        known, asked = samples.directions[~left_out], samples.directions[left_out]
        known_off, asked_off = (off[..., part].reshape(-1, part.sum()) for part in (~left_out, left_out))
        foretold = (known_off @ residual_weights(kernel, known, asked) for kernel in KERNEL_CANDIDATES)
        return [float(np.sum((asked_off - each) ** 2)) for each in foretold]

    with worker_pool() as pool:
        errors = np.sum(list(pool.map(errors_of, range(folds))), axis=0)
    return KERNEL_CANDIDATES[int(errors.argmin())]
