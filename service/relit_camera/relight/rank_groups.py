"""Clusters with equally many components, side by side: what arithmetic on arrays wants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.subject.local_basis import LocalBasis

STEP = 4
"""Ranks are rounded up to a multiple of this, with zeros: a handful of groups, and a few numbers more."""


@dataclass(frozen=True)
class RankGroup:
    """Clusters of one rank.

    Attributes:
        pixels: (clusters, places) int32 row-major.
        values: (clusters, 3, rank, places) float32.
        mixes: (clusters, rank, components) float32, scales included.
    """

    pixels: NDArray[np.int32]
    values: NDArray[np.float32]
    mixes: NDArray[np.float32]


def rank_groups(basis: LocalBasis) -> list[RankGroup]:
    """All clusters of a basis, by rising rank."""
    ranks = np.diff(basis.first)
    rounded = -(-ranks // STEP) * STEP
    groups = []
    for rank in np.unique(rounded):
        chosen = np.flatnonzero(rounded == rank)
        places = basis.pixels.shape[1]
        values = np.zeros((len(chosen), 3, rank, places), np.float32)
        mixes = np.zeros((len(chosen), rank, basis.components), np.float32)
        for index, cluster in enumerate(chosen):
            part = slice(int(basis.first[cluster]), int(basis.first[cluster + 1]))
            values[index, :, : ranks[cluster]] = basis.values[part].transpose(1, 0, 2)
            mixes[index, : ranks[cluster]] = basis.scaled_mixes(part)
        groups.append(RankGroup(basis.pixels[chosen], values, mixes))
    return groups
