"""A local basis written out, in double precision."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.subject.compression.local_basis import LocalBasis


def rows_by_hand(basis: LocalBasis, pixels: int) -> NDArray[np.float64]:
    """The row of every pixel and channel, by the definition: (pixels, 3, components)."""
    rows = np.zeros((pixels, 3, basis.components))
    for cluster, places in enumerate(basis.pixels):
        of_cluster = slice(basis.first[cluster], basis.first[cluster + 1])
        mixes = basis.scales[of_cluster, None].astype(np.float64) * basis.mixes[of_cluster].astype(np.float64)
        rows[places] = np.einsum("jcp,jg->pcg", basis.values[of_cluster].astype(np.float64), mixes, optimize=True)
    return rows
