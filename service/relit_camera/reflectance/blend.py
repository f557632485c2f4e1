"""The default: several methods that err in different ways, averaged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relit_camera.reflectance.black_ring import region_share
from relit_camera.reflectance.gaussian_process import GaussianProcess
from relit_camera.reflectance.model import Model, ModelField
from relit_camera.reflectance.samples import Samples
from relit_camera.reflectance.thesis import Thesis
from relit_camera.subject.field import ExactField, texel_vectors

Floats = NDArray[np.float32]

MODEL_WEIGHT = 2.0
"""Of the fitted model against one of each other. Weights learned by leaving lights out were no better on real faces."""


@dataclass(frozen=True)
class Blend:
    """Half `model`, a quarter each `thesis` and `gp` where lights were captured; `model` alone where none were.

    The fitted model has its shadows' edges where the horizon says, the thesis's method where neighbouring lights do,
    and the process over directions has none. Where they disagree the truth mostly lies between, and noise of
    directions and registration, which each weighs in its own way, evens out.
    """

    def build(self, samples: Samples) -> BlendField:
        """The field; see `Method.build`. It rests on `samples.geometry`."""
        return BlendField(samples, Model().build(samples), (Thesis().build(samples), GaussianProcess().build(samples)))


@dataclass(frozen=True)
class BlendField:
    """What `Blend` builds.

    Attributes:
        samples: the captured lights.
        modelled: answers every direction.
        interpolated: black beyond the sampled region, into which they fade.
    """

    samples: Samples
    modelled: ModelField
    interpolated: tuple[ExactField, ...]

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.modelled.size

    def dense(self, start: int, stop: int) -> Floats:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        parts = [field.dense(start, stop) for field in self.interpolated]
        return self._mean(self.modelled.dense(start, stop), parts, self._texel_share[None, :, None])

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        parts = [field.at(directions, pixels) for field in self.interpolated]
        share = region_share(self.samples.directions, directions)[:, None, None]
        return self._mean(self.modelled.at(directions, pixels), parts, share)

    @cached_property
    def _texel_share(self) -> Floats:
        return region_share(self.samples.directions, texel_vectors())

    @staticmethod
    def _mean(modelled: Floats, interpolated: list[Floats], share: Floats) -> Floats:
        """Interpolated parts hold their share as a factor already: it is their weight."""
        total = MODEL_WEIGHT * modelled
        for part in interpolated:
            total = total + np.maximum(part, 0)
        return np.asarray(total / (MODEL_WEIGHT + len(interpolated) * share), np.float32)
