"""The default: the fitted model of each pixel and a smooth interpolation, mixed as the capture itself says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.reflectance.appearance_field import VALIDATION_PIXELS, AppearanceField, AppearanceMethod
from relit_camera.capture.reflectance.linear_methods import RadialBasis
from relit_camera.capture.reflectance.method_registry import factored_field
from relit_camera.capture.reflectance.sampled_region import boundary_lights, region_coverage
from relit_camera.capture.reflectance.samples import Samples
from relit_camera.subject.reflectance_field import FactoredField, texel_vectors

Floats = NDArray[np.float32]

FOLDS = 4


@dataclass(frozen=True)
class Blend:
    """A mean of `model` and `rbf` where lights were captured; `model` alone where none were.

    The model has the shadows' edges where the shape says, the splines have none. Where the shape and the directions
    are exact the model is nearly always right; where they are not, the truth mostly lies between the two.
    """

    def build(self, samples: Samples) -> BlendField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        modelled = AppearanceMethod().build(samples)
        smooth = factored_field(RadialBasis(), samples)
        return BlendField(modelled, smooth, choose_model_share(modelled))


@dataclass(frozen=True)
class BlendField:
    """What `Blend` builds.

    Attributes:
        modelled: answers every direction.
        smooth: black beyond the sampled region, into which it fades.
        share: of the model inside the region; the rest is the smooth field's.
    """

    modelled: AppearanceField
    smooth: FactoredField
    share: float

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.modelled.size

    def dense(self, start: int, stop: int) -> Floats:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        return self._mixed(
            self.modelled.dense(start, stop), self.smooth.dense(start, stop), self._texels_covered[:, None]
        )

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        covered = region_coverage(self.smooth.directions, directions)[:, None, None]
        return self._mixed(self.modelled.at(directions, pixels), self.smooth.at(directions, pixels), covered)

    @cached_property
    def _texels_covered(self) -> Floats:
        return region_coverage(self.smooth.directions, texel_vectors())

    def _mixed(self, modelled: Floats, smooth: Floats, covered: Floats) -> Floats:
        """One field of two, which is written over the first.

        What the smooth field answers has `covered` in it as a factor already: it is its weight.
        """
        rest = 1 - self.share
        total = self.share + rest * covered + 1e-9
        modelled *= self.share / total
        modelled += np.maximum(smooth, 0) * (rest / total)
        return modelled


def choose_model_share(modelled: AppearanceField) -> float:
    """The model's share that foretells best the lights that neither part was fitted to: 0 to 1.

    Cross-validation over the lights that others surround, by some pixels: least squares (stacking; Breiman 1996).
    The model's shape and kernel are those of all lights, so those judged are not wholly unseen; and its appearance is
    fitted without what neighbours tell of highlights, which the field's own has.
    """
    samples = modelled.samples
    lights = len(samples.directions)
    surrounded = np.setdiff1d(np.arange(lights), boundary_lights(samples.directions))
    inside = np.flatnonzero(samples.matte.ravel() > 0.5)
    pixels = inside[:: max(1, len(inside) // VALIDATION_PIXELS)]
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
        asked = samples.directions[left_out]
        smooth = np.maximum(factored_field(RadialBasis(), known).at(asked, pixels), 0)
        apart = modelled.fitted_to(known, pixels).at(asked, pixels) - smooth
        truth = samples.pictures.reshape(lights, -1, 3)[left_out][:, pixels]
        agreement += float(np.vdot(apart, truth - smooth))
        distance += float(np.vdot(apart, apart))
    return float(np.clip(agreement / distance, 0, 1)) if distance else 1.0
