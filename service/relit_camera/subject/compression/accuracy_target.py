"""The accuracy that a compressed field must reach, which decides how large a subject file becomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.light_map import LightMap
from relit_camera.subject.reflectance_field import TEXELS

DARK_LIGHT_FRACTION = 0.01
"""Least peak that accuracy is relative to, as a share of the brightest light's: darker pictures may have larger errors
relative to their own peak."""


@dataclass(frozen=True)
class CompressionTarget:
    """Least PSNR, in dB, of pictures of the compressed field inside the matte (see `base.images.image_quality.psnr`).

    Attributes:
        texel_db: of the picture under any single texel, by its own peak; light maps mix texels and are no worse.
        light_db: of the picture of any captured light.
        maps: light maps (32, 64, 3) under which the quality of the result is measured too.
    """

    texel_db: float = 43.0
    light_db: float = 46.0
    maps: Sequence[LightMap] = ()

    def allowed(self, peaks: NDArray[np.floating]) -> NDArray[np.float32]:
        """Allowed root mean square error (columns,), by the peak of each column: texels, then captured lights."""
        decibels = np.full(len(peaks), self.light_db)
        decibels[:TEXELS] = self.texel_db
        reference = np.maximum(peaks, max(DARK_LIGHT_FRACTION * float(peaks.max()), 1e-6))
        return np.asarray(reference * 10 ** (-decibels / 20), np.float32)

    @property
    def light(self) -> NDArray[np.float32]:
        """The maps' radiance times solid angle, (maps, 2048, 3)."""
        weighted = [each * texel_solid_angles()[..., None] for each in self.maps]
        return np.asarray(weighted, np.float32).reshape(-1, TEXELS, 3)
