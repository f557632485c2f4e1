"""Relighting in the subject's bases with NumPy: three small matrix products instead of one large one.

Clusters of equal rank lie side by side in one array, so that one product serves all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.light.light_map import LightMap
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.relighting.relighter import RelighterOptions, weighted_light
from relit_camera.subject.subject import Subject

RANK_STEP = 4
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


def group_by_rank(basis: LocalBasis) -> list[RankGroup]:
    """All clusters of a basis, by rising rank."""
    ranks = np.diff(basis.first)
    rounded = -(-ranks // RANK_STEP) * RANK_STEP
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


COMPONENTS_PER_BLOCK = 64
"""Local components multiplied at once: their mixes stay in the cache for all three channels, and the product takes a
third of the time that BLAS has for a tall matrix times three columns."""


class BasisRelighter:
    """coefficients × light, local components × that, and in each cluster its pixels × its components.

    Clusters of equal rank are multiplied together. Their values are kept as float32 (clusters, 3, components, places):
    the last product streams through memory once. Pixels of no cluster come back black.
    """

    name, provider = "basis", "numpy"

    def __init__(self, subject: Subject, options: RelighterOptions | None = None) -> None:
        """`options` are those of every relighter, and change nothing here."""
        self._shape = (subject.metadata.height, subject.metadata.width)
        self._coefficients = subject.coefficients
        groups = group_by_rank(subject.basis)
        self._values = [group.values for group in groups]
        self._mixes = _blocks(np.concatenate([group.mixes.reshape(-1, subject.basis.components) for group in groups]))
        pixels = np.concatenate([group.pixels for group in groups])
        # Where each value of the picture stands among all clusters' (clusters, 3, places); what is in none is behind.
        self._found = pixels.size * 3
        self._source = np.full((subject.matte.size, 3), self._found, np.intp)
        places = np.arange(self._found).reshape(len(pixels), 3, -1).transpose(0, 2, 1)
        self._source[pixels] = places

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays that it keeps in memory."""
        return sum(each.nbytes for each in (*self._values, self._mixes, self._coefficients))

    def relight(self, light_map: LightMap) -> LinearImage:
        """See `Relighter.relight`."""
        return self.mix(self._coefficients @ weighted_light(light_map))

    def mix(self, amounts: NDArray[np.float32]) -> LinearImage:
        """The picture of `amounts` (components, 3) of the shared basis: float32 (height, width, 3)."""
        local = np.matmul(np.ascontiguousarray(amounts.T), self._mixes).transpose(0, 2, 1).reshape(-1, 3)
        found = np.empty(self._found + 1, np.float32)
        found[-1] = 0
        component = start = 0
        for values in self._values:
            clusters, _, rank, places = values.shape
            mixed = local[component : component + clusters * rank].reshape(clusters, rank, 3).transpose(0, 2, 1)
            target = found[start : start + clusters * 3 * places].reshape(clusters, 3, 1, places)
            np.matmul(mixed[:, :, None], values, out=target)
            component += clusters * rank
            start += target.size
        return found.take(self._source).reshape(*self._shape, 3)


def _blocks(mixes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mixes (count, components) as (blocks, components, BLOCK), filled up with zeros."""
    padded = np.pad(mixes, ((0, -len(mixes) % COMPONENTS_PER_BLOCK), (0, 0)))
    return np.ascontiguousarray(padded.reshape(-1, COMPONENTS_PER_BLOCK, mixes.shape[1]).transpose(0, 2, 1))
