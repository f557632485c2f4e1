"""Relighting in the subject's bases on the CPU: three small products instead of one large one, on 8-bit numbers.

Relighting waits for memory more than it computes, so the numbers are kept as small as in the file. Clusters of equal
rank lie side by side in one array, so that one product serves all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.relighting.integer_product import ClusterProducts, IntegerProduct, quantize
from relit_camera.subject.relighting.relighter import RelighterOptions, weighted_light
from relit_camera.subject.subject import Subject

RANK_STEP = 8
"""Ranks are rounded up to a multiple of this, with zeros: a handful of groups, and a few numbers more."""


@dataclass(frozen=True)
class RankGroup:
    """Clusters of one rank.

    Attributes:
        pixels: (clusters, places) int32 row-major.
        values: (clusters, 3, rank, places) int8 or float16.
        mixes: (clusters, rank, components) float32, units of the values included.
    """

    pixels: NDArray[np.int32]
    values: NDArray[np.int8] | NDArray[np.float16]
    mixes: NDArray[np.float32]


def rounded_ranks(basis: LocalBasis) -> NDArray[np.int32]:
    """The rank (clusters,) that each cluster has in its group."""
    return np.asarray(-(-np.diff(basis.first) // RANK_STEP) * RANK_STEP, np.int32)


def groups_by_rank(basis: LocalBasis) -> Iterator[RankGroup]:
    """All clusters of a basis, by rising rank; one group at a time, because mixes are large as floats."""
    ranks, rounded = np.diff(basis.first), rounded_ranks(basis)
    for rank in np.unique(rounded):
        chosen = np.flatnonzero(rounded == rank)
        grouped = np.zeros((len(chosen), 3, rank, basis.pixels.shape[1]), basis.values.dtype)
        mixes = np.zeros((len(chosen), rank, basis.components), np.float32)
        for index, cluster in enumerate(chosen):
            part = slice(int(basis.first[cluster]), int(basis.first[cluster + 1]))
            grouped[index, :, : ranks[cluster]] = basis.values[part].transpose(1, 0, 2)
            mixes[index, : ranks[cluster]] = basis.scaled_mixes(part)
        yield RankGroup(basis.pixels[chosen], grouped, mixes)


def in_8_bits(basis: LocalBasis) -> LocalBasis:
    """The basis with int8 values; for each component of float16 it has two, the second of what the first leaves."""
    if basis.values.dtype == np.int8:
        return basis
    count = len(basis.values)
    values = np.empty((count, 2, *basis.values.shape[1:]), np.int8)
    scales = np.empty((count, 2), np.float32)
    for index in range(count):
        rest = basis.values[index].reshape(1, -1).astype(np.float32)
        for half in range(2):
            rounded = quantize(rest)
            rest -= rounded.restored()
            values[index, half] = rounded.codes.reshape(values.shape[2:])
            scales[index, half] = rounded.scales[0] * basis.scales[index]
    return LocalBasis(
        pixels=basis.pixels,
        first=2 * basis.first,
        values=values.reshape(-1, *values.shape[2:]),
        scales=scales.ravel(),
        mixes=np.repeat(basis.mixes, 2, axis=0),
    )


class BasisRelighter:
    """coefficients × light, local components × that, and in each cluster its pixels × its components.

    Clusters of equal rank are multiplied together. Pixels of no cluster come back black. Threads may share it.
    """

    name, provider = "basis", "cpu"

    def __init__(self, subject: Subject, options: RelighterOptions | None = None) -> None:
        """Of `options` it takes the number of threads; it always runs on the CPU."""
        threads = (options or RelighterOptions()).session.threads
        self._shape = (subject.metadata.height, subject.metadata.width)
        self._coefficients = subject.coefficients
        basis = in_8_bits(subject.basis)
        values: list[NDArray[Any]] = []
        pixels: list[NDArray[np.int32]] = []

        def mixes() -> Iterator[NDArray[np.float32]]:
            for group in groups_by_rank(basis):
                values.append(group.values)
                pixels.append(group.pixels)
                for part in np.array_split(group.mixes, len(group.mixes)):
                    yield part.reshape(-1, basis.components)

        rows = int(rounded_ranks(basis).sum())
        self._mixes = IntegerProduct(rows, basis.components, mixes(), threads)
        self._clusters = ClusterProducts(values, threads)
        # Where each value of the picture stands among the clusters' products; what is in no cluster is behind them.
        self._source = np.full((subject.matte.size, 3), self._clusters.size, np.intp)
        for group, positions in zip(pixels, self._clusters.positions(), strict=True):
            self._source[group] = positions

    @property
    def nbytes(self) -> int:
        """Bytes that are read for a picture."""
        return self._coefficients.nbytes + self._mixes.nbytes + self._clusters.nbytes

    def relight(self, light_maps: NDArray[np.float32]) -> NDArray[np.float32]:
        """See `Relighter.relight`."""
        count = len(light_maps)
        light = weighted_light(light_maps).transpose(2, 0, 1).reshape(3 * count, -1)
        local = self._mixes(light @ self._coefficients.T).reshape(3, count, -1)
        return self._clusters(local).take(self._source, axis=1, mode="clip").reshape(count, *self._shape, 3)
