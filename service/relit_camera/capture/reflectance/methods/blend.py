"""The method `blend`, the default: `model` and `rbf` mixed in a proportion that cross-validation chooses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.capture.reflectance.method_registry import factored_field
from relit_camera.capture.reflectance.methods.appearance_field import (
    RESIDUAL,
    AppearanceField,
    AppearanceMethod,
)
from relit_camera.capture.reflectance.methods.linear_methods import RadialBasis
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import boundary_lights, region_coverage
from relit_camera.subject.reflectance_field import FactoredField, texel_vectors

FOLDS = 4
"""Parts of the cross-validation."""


@dataclass(frozen=True)
class Blend:
    """A weighted mean of `model` and `rbf` inside the sampled region; `model` alone beyond it.

    The model has shadow edges where the geometry puts them, the splines have none. Where geometry and directions are
    exact the model is nearly always right; where they are not, the truth mostly lies between the two.
    """

    def build(self, samples: OlatSamples) -> BlendField:
        """The field; see `ReflectanceMethod.build`. It uses `samples.geometry`."""
        modelled = AppearanceMethod().build(samples)
        smooth = factored_field(RadialBasis(), samples)
        return BlendField(modelled, smooth, choose_model_fraction(modelled))


@dataclass(frozen=True)
class BlendField:
    """The field that `Blend` builds.

    Attributes:
        modelled: the field of `model`, for every direction.
        smooth: the field of `rbf`, which fades to black beyond the sampled region.
        fraction: weight of the model inside the region, 0..1; the smooth field has the rest.
    """

    modelled: AppearanceField
    smooth: FactoredField
    fraction: float

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.modelled.size

    def dense(self, start: int, stop: int) -> Float32Array:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        return self._mixed(
            self.modelled.dense(start, stop), self.smooth.dense(start, stop), self._texels_covered[:, None]
        )

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        covered = region_coverage(self.smooth.directions, directions)[:, None, None]
        return self._mixed(self.modelled.at(directions, pixels), self.smooth.at(directions, pixels), covered)

    @cached_property
    def _texels_covered(self) -> Float32Array:
        return region_coverage(self.smooth.directions, texel_vectors())

    def _mixed(self, modelled: Float32Array, smooth: Float32Array, covered: Float32Array) -> Float32Array:
        """The weighted mean of both fields, written over `modelled`.

        `covered` is the weight of the smooth field, whose values have it as a factor already.
        """
        rest = 1 - self.fraction
        modelled *= self.fraction + rest * (1 - covered)
        modelled += np.maximum(smooth, 0) * rest
        return modelled


def choose_model_fraction(modelled: AppearanceField) -> float:
    """The model's weight 0..1 that best predicts lights left out of both fits (stacking; Breiman 1996).

    Cross-validation in FOLDS parts over the lights that others surround, by least squares over some pixels. Geometry
    and kernel are those of all lights, so those left out are not wholly unseen; and unlike the final field the
    appearance is fitted without the specular prior.
    """
    samples = modelled.samples
    lights = len(samples.directions)
    surrounded = np.setdiff1d(np.arange(lights), boundary_lights(samples.directions))
    inside = np.flatnonzero(samples.matte.ravel() > 0.5)
    pixels = inside[:: max(1, len(inside) // RESIDUAL.validation_pixels)]
    agreement = distance = 0.0
    for fold in range(FOLDS):
        left_out = surrounded[fold::FOLDS]
        if not len(left_out):
            continue
        kept = np.setdiff1d(np.arange(lights), left_out)
        known = replace(
            samples,
            pictures=samples.pictures[kept],
            directions=samples.directions[kept],
            known_geometry=samples.geometry,
        )
        queries = samples.directions[left_out]
        smooth = np.maximum(factored_field(RadialBasis(), known).at(queries, pixels), 0)
        difference = modelled.fitted_to(known, pixels).at(queries, pixels) - smooth
        truth = samples.pictures.reshape(lights, -1, 3)[left_out][:, pixels]
        agreement += float(np.vdot(difference, truth - smooth))
        distance += float(np.vdot(difference, difference))
    return float(np.clip(agreement / distance, 0, 1)) if distance else 1.0
