"""The seam between light and picture: O[p] = Σ_l R[p, l] · E[l] · ω_l, per colour channel (thesis 6.1).

Relighting with the whole reflectance matrix (thesis 6.2): the reference of tests and bench.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import NotFoundError
from relit_camera.base.images.image_types import LinearImage
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.light_map import LightMap
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.subject import Subject

RELIGHTER_ENTRY_POINTS = "relit_camera.relighters"


class Relighter(Protocol):
    """Relights one subject. Holds its data in the form that its arithmetic wants. Thread-safe."""

    def relight(self, light_map: LightMap) -> LinearImage:
        """The subject under a light map (32, 64, 3): float32 linear (height, width, 3), unscaled and unclipped.

        Black where the matte is 0.
        """
        ...


def weighted_light(light_map: LightMap) -> NDArray[np.float32]:
    """E[l] · ω_l as float32 (2048, 3): the right-hand side of the relighting product."""
    omega = texel_solid_angles().astype(np.float32)
    return np.ascontiguousarray((light_map * omega[..., None]).reshape(TEXELS, 3))


def open_relighter(name: str, subject: Subject) -> Relighter:
    """A relighter of that name for `subject`.

    Raises:
        NotFoundError: none of that name is installed.
    """
    for point in entry_points(group=RELIGHTER_ENTRY_POINTS, name=name):
        relighter: Relighter = point.load()(subject)
        return relighter
    known = ", ".join(sorted(point.name for point in entry_points(group=RELIGHTER_ENTRY_POINTS)))
    raise NotFoundError(f"no relighter '{name}'", f"there are: {known}")


PIXELS_PER_BLOCK = 4096
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
    for start in range(0, total, PIXELS_PER_BLOCK):
        pixels = np.arange(start, min(start + PIXELS_PER_BLOCK, total))
        matrix[:, pixels] = subject.basis.at(subject.coefficients, pixels).transpose(2, 1, 0)
    return matrix
