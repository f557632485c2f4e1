"""The nearest captured light: the baseline under all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.reflectance.method import factored_field
from relit_camera.reflectance.samples import Samples
from relit_camera.subject.field import FactoredField

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
