"""Relighting in the subject's basis: two small products instead of one large one."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.light.maps import LightMap
from relit_camera.relight.relighter import weighted_light
from relit_camera.space.images import LinearImage
from relit_camera.subject.subject import Subject


class BasisRelighter:
    """O = Σ_k basis_k · (coefficients_k · E ω): the default.

    The basis is kept as float32 (3, components, pixels): a row is one principal picture, so that the second product
    streams through memory once, and BLAS shares it among its threads. Pixels outside the matte are left out; they
    come back black.
    """

    def __init__(self, subject: Subject) -> None:
        self._shape = (subject.metadata.height, subject.metadata.width)
        inside = np.flatnonzero(subject.matte.ravel() > 0)
        self._inside = None if len(inside) == subject.matte.size else inside
        basis = subject.basis.reshape(3, subject.metadata.components, -1)
        if self._inside is not None:
            basis = basis[:, :, self._inside]
        self._basis = np.ascontiguousarray(basis, dtype=np.float32)
        self._coefficients = subject.coefficients

    def relight(self, light_map: LightMap) -> LinearImage:
        """See `Relighter.relight`."""
        return self.mix(self._coefficients @ weighted_light(light_map))

    def mix(self, amounts: NDArray[np.float32]) -> LinearImage:
        """The picture of `amounts` (components, 3) of the principal pictures: float32 (height, width, 3)."""
        planes = [amounts[:, channel] @ self._basis[channel] for channel in range(3)]
        if self._inside is None:
            return np.asarray(cv2.merge([plane.reshape(self._shape) for plane in planes]), dtype=np.float32)
        picture = np.zeros((*self._shape, 3), dtype=np.float32)
        picture.reshape(-1, 3)[self._inside] = cv2.merge(planes).reshape(-1, 3)
        return picture
