"""A local basis written out, in double precision."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.subject.compression.local_basis import LocalBasis


def rows_by_hand(basis: LocalBasis, pixels: int) -> NDArray[np.float64]:
    """The row of every pixel and channel, by the definition: (pixels, 3, components)."""
    rows = np.zeros((pixels, 3, basis.components))
    for cluster, places in enumerate(basis.pixels):
        for place, pixel in enumerate(places):
            rows[pixel] = 0
            for j in range(basis.first[cluster], basis.first[cluster + 1]):
                mix = basis.scales[j].astype(np.float64) * basis.mixes[j].astype(np.float64)
                rows[pixel] += basis.values[j, :, place].astype(np.float64)[:, None] * mix
    return rows
