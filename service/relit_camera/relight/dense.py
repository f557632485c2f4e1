"""Relighting with the whole reflectance matrix (thesis 6.2): the reference of tests and bench."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.maps import LightMap
from relit_camera.relight.relighter import weighted_light
from relit_camera.space.images import LinearImage
from relit_camera.subject.field import TEXELS
from relit_camera.subject.subject import Subject

BLOCK = 4096
"""Pixels restored at once: 100 MB."""


class DenseRelighter:
    """O = R · (E ω) with the matrix held in memory.

    Attributes:
        matrix: R as (3, pixels, 2048) float32: 737 MB for 150 x 200 pixels.
    """

    def __init__(self, subject: Subject) -> None:
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
    for start in range(0, total, BLOCK):
        pixels = np.arange(start, min(start + BLOCK, total))
        matrix[:, pixels] = subject.basis.at(subject.coefficients, pixels).transpose(2, 1, 0)
    return matrix
