"""What is asked of a compressed field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.maps import LightMap
from relit_camera.space.directions import texel_solid_angles
from relit_camera.subject.field import TEXELS
from relit_camera.subject.reached import DARK


@dataclass(frozen=True)
class Target:
    """How well pictures must come back inside the matte, in dB (see `space.quality.psnr`).

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
        judged = np.maximum(peaks, max(DARK * float(peaks.max()), 1e-6))
        return np.asarray(judged * 10 ** (-decibels / 20), np.float32)

    @property
    def light(self) -> NDArray[np.float32]:
        """The maps' radiance times solid angle, (maps, 2048, 3)."""
        weighted = [each * texel_solid_angles()[..., None] for each in self.maps]
        return np.asarray(weighted, np.float32).reshape(-1, TEXELS, 3)
