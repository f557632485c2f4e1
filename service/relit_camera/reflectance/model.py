"""A fitted model of each pixel's appearance, and what it leaves unexplained interpolated over directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from relit_camera.reflectance.appearance import TERMS, distant_terms, fit_appearance, lit_shares
from relit_camera.reflectance.black_ring import region_share
from relit_camera.reflectance.gaussian_process import Kernel
from relit_camera.reflectance.samples import Samples
from relit_camera.subject.field import texel_vectors

Floats = NDArray[np.float32]

BLOCK = 512
"""Pixels fitted or answered at a time: 21 MB of terms for 2048 directions."""
JUDGES = 4096
"""Pixels by which the residual's kernel is chosen."""
FOLDS = 5
NEAR_REACH = float(np.radians(4.0))
MAKE_UP = 2.0
"""With fewer captured lights on a pixel's own side of the shadow than half by weight, less of the residual is known."""
MEASUREMENT = 0.01
"""Variance of the pictures' own noise."""
CANDIDATES = [
    Kernel(float(np.radians(reach)), noise) for reach in (10, 15, 20, 30, 45, 70) for noise in (0.03, 0.1, 0.3, 1.0)
]


@dataclass(frozen=True)
class Model:
    """Appearance plus residual.

    The appearance model reaches beyond the sampled region, where interpolation has nothing to say; the residual, a
    Gaussian process about 0, ends there by itself.
    """

    def build(self, samples: Samples) -> ModelField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        region_share(samples.directions, samples.directions[:1])
        inside = np.flatnonzero(samples.matte.ravel() > 0)
        judges = inside[:: max(1, len(inside) // JUDGES)]
        return ModelField(samples, _fit(samples, inside), choose_kernel(samples, judges))


@dataclass(frozen=True)
class ModelField:
    """What `Model` builds.

    Attributes:
        samples: the captured lights.
        amounts: (pixels, TERMS, 3) of the appearance's terms.
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
        found = self._answer(texel_vectors(), self._texel_weights, np.arange(start, stop))
        return np.ascontiguousarray(found.transpose(1, 0, 2))

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        return self._answer(directions, residual_weights(self.kernel, self.samples.directions, directions), pixels)

    @cached_property
    def _texel_weights(self) -> Floats:
        return residual_weights(self.kernel, self.samples.directions, texel_vectors())

    def fitted_to(self, samples: Samples, pixels: NDArray[np.intp]) -> ModelField:
        """The same model of other samples of this person, fitted at some row-major pixels only."""
        return ModelField(samples, _fit(samples, pixels), self.kernel)

    def appearance_at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
        """R as `at`, without the residual."""
        return _modelled(self.samples, self.amounts, directions, pixels)

    def _answer(self, directions: NDArray[np.float64], weights: Floats, pixels: NDArray[np.intp]) -> Floats:
        result = np.empty((len(directions), len(pixels), 3), np.float32)
        for start in range(0, len(pixels), BLOCK):
            block = pixels[start : start + BLOCK]
            found = _modelled(self.samples, self.amounts, directions, block)
            found += self._residual(directions, weights, block)
            # The terms are not negative, and no light takes light away.
            result[:, start : start + BLOCK] = np.maximum(found, 0)
        return result

    def _residual(self, directions: NDArray[np.float64], weights: Floats, pixels: NDArray[np.intp]) -> Floats:
        """The residual (count, pixels, 3) that the captured lights foretell: lit ones for lit pixels, others for dark.

        What the model is wrong by in the light says nothing of the shadow, and the other way round.
        """
        known, shape = self.samples.directions, self.samples.geometry
        left = residual(self.samples, self.amounts, pixels)
        lit, asked = (lit_shares(shape, each, pixels)[..., None] for each in (known, directions))
        in_light, in_shadow = (_foretold(weights, share, left) for share in (lit, 1 - lit))
        return np.asarray(asked * in_light + (1 - asked) * in_shadow)


def _foretold(weights: Floats, share: Floats, left: Floats) -> Floats:
    """Residuals (count, pixels, 3) by weights (lights, count); captured ones (lights, pixels, 3) count by their share.

    The weights' sum over those that count is made up to the sum of all, within MAKE_UP.
    """
    counted = np.tensordot(weights.T, share, 1)
    factor = np.clip(weights.sum(axis=0)[:, None, None] / np.maximum(counted, 1e-3), 0, MAKE_UP)
    return np.asarray(np.tensordot(weights.T, share * left, 1) * factor)


def _fit(samples: Samples, pixels: NDArray[np.intp]) -> Floats:
    """Amounts of all pixels (height · width, TERMS, 3), 0 but at the given ones."""
    pictures = samples.pictures.reshape(len(samples.directions), -1, 3)
    amounts = np.zeros((pictures.shape[1], TERMS, 3), np.float32)
    bright = _bright(samples)
    for start in range(0, len(pixels), BLOCK):
        block = pixels[start : start + BLOCK]
        terms = distant_terms(samples.geometry, samples.directions, block)
        amounts[block] = fit_appearance(terms, pictures[:, block], bright)
    return amounts


def _bright(samples: Samples) -> float:
    """The 99th percentile of the person's values."""
    inside = np.flatnonzero(samples.matte.ravel() > 0.5)
    some = inside[:: max(1, len(inside) // JUDGES)]
    return float(np.percentile(samples.pictures.reshape(len(samples.directions), -1, 3)[:, some], 99))


def _modelled(samples: Samples, amounts: Floats, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
    """The appearance (count, pixels, 3) of row-major pixels under unit vectors (count, 3)."""
    terms = distant_terms(samples.geometry, directions, pixels).transpose(1, 0, 2)
    return np.asarray((terms @ amounts[pixels]).transpose(1, 0, 2))


def residual(samples: Samples, amounts: Floats, pixels: NDArray[np.intp]) -> Floats:
    """What the appearance leaves of the pictures at row-major pixels: (lights, pixels, 3)."""
    pictures = samples.pictures.reshape(len(samples.directions), -1, 3)[:, pixels]
    return np.asarray(pictures - _modelled(samples, amounts, samples.directions, pixels))


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
    """The residual's kernel that foretells lights best which neither it nor the appearance has seen.

    Cross-validation in FOLDS parts over row-major pixels. What the appearance leaves of lights that it was fitted to
    is smaller and rougher than what it leaves of others, so leaving lights out of the residual alone misleads.
    """
    lights = len(samples.directions)
    values = samples.pictures.reshape(lights, -1, 3)[:, pixels]
    terms = distant_terms(samples.geometry, samples.directions, pixels)
    errors = np.zeros(len(CANDIDATES))
    for fold in range(FOLDS):
        left_out = np.arange(lights) % FOLDS == fold
        amounts = fit_appearance(terms[~left_out], values[~left_out], _bright(samples))
        off = values - (terms.transpose(1, 0, 2) @ amounts).transpose(1, 0, 2)
        known, asked = samples.directions[~left_out], samples.directions[left_out]
        for index, kernel in enumerate(CANDIDATES):
            foretold = np.tensordot(residual_weights(kernel, known, asked).T, off[~left_out], 1)
            errors[index] += float(np.sum((off[left_out] - foretold) ** 2))
    return CANDIDATES[int(errors.argmin())]
