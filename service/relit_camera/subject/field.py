"""The reflectance field: how every pixel answers light from every direction (thesis 5.1).

R[p, l] is the picture under a distant light of unit irradiance from direction l, so a captured frame is its own
sample. Solid angles are no part of it: they belong to the operator that sums over directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relit_camera.space.directions import MAP_HEIGHT, MAP_WIDTH

TEXELS = MAP_HEIGHT * MAP_WIDTH


class ReflectanceField(Protocol):
    """What a method builds from samples."""

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        ...

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        ...


@dataclass(frozen=True)
class FactoredField:
    """A field whose interpolation weights are the same for all pixels: R[p, l] = Σ_n pictures[n, p] · weights[n, l].

    Its rank is at most the number of captured lights, so it compresses without loss (thesis notes, 9).

    Attributes:
        pictures: (lights, height, width, 3) float32 linear, each under unit irradiance from its own direction.
        directions: (lights, 3) float64 unit vectors.
        weights: (lights, 2048) float32; a column sums to 1 inside the sampled region and to 0 outside.
    """

    pictures: NDArray[np.float32]
    directions: NDArray[np.float64]
    weights: NDArray[np.float32]

    def __post_init__(self) -> None:
        lights = self.pictures.shape[0]
        if self.pictures.ndim != 4 or self.directions.shape != (lights, 3) or self.weights.shape != (lights, TEXELS):
            shapes = self.pictures.shape, self.directions.shape, self.weights.shape
            raise ValueError(f"pictures, directions and weights do not fit together: {shapes}")

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.pictures.shape[1], self.pictures.shape[2]

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        lights = self.pictures.shape[0]
        block = self.pictures.reshape(lights, -1, 3)[:, start:stop]
        return np.asarray(np.einsum("npc,nl->plc", block, self.weights, optimize=True), dtype=np.float32)
