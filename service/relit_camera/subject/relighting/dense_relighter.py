"""Relighting with the whole reflectance matrix (thesis 6.2): exact, large, slow: the reference of tests and bench."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.light.light_map import LightMap
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.relighting.relighter import RelighterOptions, weighted_light
from relit_camera.subject.subject import Subject

PIXELS_PER_BLOCK = 4096
"""Pixels decompressed at once: 100 MB."""


class DenseRelighter:
    """O = R · (E ω) with the matrix held in memory.

    Attributes:
        matrix: R as (3, pixels, 2048) float32: 737 MB for 150 x 200 pixels.
    """

    name, provider = "dense", "numpy"

    def __init__(self, subject: Subject, options: RelighterOptions | None = None) -> None:
        """`options` are those of every relighter, and change nothing here."""
        self._shape = (subject.metadata.height, subject.metadata.width)
        self.matrix = dense_matrix(subject)

    def relight(self, light_map: LightMap) -> LinearImage:
        """See `Relighter.relight`."""
        light = weighted_light(light_map)
        planes = [self.matrix[channel] @ light[:, channel] for channel in range(3)]
        return np.stack(planes, axis=-1).reshape(*self._shape, 3)


def dense_matrix(subject: Subject) -> NDArray[np.float32]:
    """R as (3, pixels, 2048) float32, 0 where the matte is."""
    total = subject.matte.size
    matrix = np.empty((3, total, TEXELS), dtype=np.float32)
    for start in range(0, total, PIXELS_PER_BLOCK):
        pixels = np.arange(start, min(start + PIXELS_PER_BLOCK, total))
        matrix[:, pixels] = subject.basis.at(subject.coefficients, pixels).transpose(2, 1, 0)
    return matrix
