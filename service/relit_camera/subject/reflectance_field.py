"""The reflectance field: the color of every pixel under light from every direction (thesis 5.1).

R[p, l] is the picture under a distant light of unit irradiance from direction l, so a captured frame is its own
sample. Solid angles are not included: they belong to the operator that sums over directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, texel_directions

TEXELS = MAP_HEIGHT * MAP_WIDTH


class ReflectanceField(Protocol):
    """A reflectance field, as a method builds it from samples."""

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        ...

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        ...


@runtime_checkable
class ExactField(ReflectanceField, Protocol):
    """A field that can be evaluated at any direction, not only at texels."""

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        ...


def texel_vectors() -> NDArray[np.float64]:
    """Unit vectors (2048, 3) toward the texels of a light map, in its order."""
    return texel_directions().reshape(TEXELS, 3)


@dataclass(frozen=True)
class FactoredField:
    """A field whose interpolation weights are the same for all pixels: R[p, l] = Σ_n pictures[n, p] · weights[n, l].

    Its rank is at most the number of captured lights, so it compresses without loss (thesis notes, 9).

    Attributes:
        pictures: (lights, height, width, 3) float32 linear, each under unit irradiance from its own direction.
        directions: (lights, 3) float64 unit vectors.
        interpolation: unit vectors (count, 3) → weights (lights, count) float32; a column sums to 1 inside the sampled
            region and to 0 far from it.
    """

    pictures: NDArray[np.float32]
    directions: NDArray[np.float64]
    interpolation: Callable[[NDArray[np.float64]], NDArray[np.float32]]

    def __post_init__(self) -> None:
        lights = self.pictures.shape[0]
        if self.pictures.ndim != 4 or self.directions.shape != (lights, 3):
            raise ValueError(f"pictures and directions do not fit: {self.pictures.shape}, {self.directions.shape}")

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.pictures.shape[1], self.pictures.shape[2]

    @cached_property
    def weights(self) -> NDArray[np.float32]:
        """The weights (lights, 2048) of the texels."""
        return self.interpolation(texel_vectors())

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        block = self.pictures.reshape(len(self.pictures), -1, 3)[:, start:stop]
        rows = block.reshape(len(block), -1).T @ self.weights
        return np.asarray(rows.reshape(stop - start, 3, TEXELS).transpose(0, 2, 1), np.float32)

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        block = self.pictures.reshape(len(self.pictures), -1, 3)[:, pixels]
        return np.asarray(np.tensordot(self.interpolation(directions).T, block, 1), np.float32)
