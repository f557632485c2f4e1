"""A local basis written out, in double precision."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.subject.compression.local_basis import LocalBasis


def rows_by_hand(basis: LocalBasis, pixels: int) -> NDArray[np.float64]:
    """The row of every pixel and channel, by the definition: (pixels, 3, components)."""
    rows = np.zeros((pixels, 3, basis.components))
    for cluster, places in enumerate(basis.pixels):
        part = range(basis.first[cluster], basis.first[cluster + 1])
        mixes = [basis.scales[j].astype(np.float64) * basis.mixes[j].astype(np.float64) for j in part]
        values = [basis.values[j].astype(np.float64) for j in part]
        for place, pixel in enumerate(places):
            rows[pixel] = sum((v[:, place, None] * mix for v, mix in zip(values, mixes, strict=True)), np.zeros(1))
    return rows
