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
    streams through memory once, and BLAS shares it among its threads.
    """

    def __init__(self, subject: Subject) -> None:
        self._basis = subject.basis.astype(np.float32).reshape(3, subject.metadata.components, -1)
        self._coefficients = subject.coefficients
        self._shape = (subject.metadata.height, subject.metadata.width)

    def relight(self, light_map: LightMap) -> LinearImage:
        """See `Relighter.relight`."""
        return self.mix(self._coefficients @ weighted_light(light_map))

    def mix(self, amounts: NDArray[np.float32]) -> LinearImage:
        """The picture of `amounts` (components, 3) of the principal pictures: float32 (height, width, 3)."""
        planes = [amounts[:, channel] @ self._basis[channel] for channel in range(3)]
        return np.asarray(cv2.merge([plane.reshape(self._shape) for plane in planes]), dtype=np.float32)
