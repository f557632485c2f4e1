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
"""A light whose picture is darker than this share of the brightest light's is judged by that."""


@dataclass(frozen=True)
class CompressionTarget:
    """How well pictures must come back inside the matte, in dB (see `base.images.image_quality.psnr`).

    Attributes:
        texel_db: of any texel alone, by its own peak: light maps, which mix them, are then no worse.
        light_db: of any captured light.
        maps: light maps (32, 64, 3) that the result is tried on.
    """

    texel_db: float = 43.0
    light_db: float = 46.0
    maps: Sequence[LightMap] = ()

    def allowed(self, peaks: NDArray[np.floating]) -> NDArray[np.float32]:
        """Root mean square error (columns,) allowed, by the peak of each column: texels, then captured lights."""
        decibels = np.full(len(peaks), self.light_db)
        decibels[:TEXELS] = self.texel_db
        judged = np.maximum(peaks, max(DARK_LIGHT_FRACTION * float(peaks.max()), 1e-6))
        return np.asarray(judged * 10 ** (-decibels / 20), np.float32)

    @property
    def light(self) -> NDArray[np.float32]:
        """The maps' radiance times solid angle, (maps, 2048, 3)."""
        weighted = [each * texel_solid_angles()[..., None] for each in self.maps]
        return np.asarray(weighted, np.float32).reshape(-1, TEXELS, 3)
