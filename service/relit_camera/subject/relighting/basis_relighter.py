"""Relighting in the subject's bases on the CPU: small products instead of one large one, most of them in 8 bits.

Relighting waits for memory more than it computes, so the numbers are kept as small as in the file. Clusters of equal
rank lie side by side in one array, so that one product serves all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import Session
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.relighting.component_pictures import ComponentPictures, component_bytes
from relit_camera.subject.relighting.integer_product import (
    CHANNEL_STEPS,
    HEAD_COLUMNS,
    ClusterProducts,
    IntegerProduct,
    quantize,
)
from relit_camera.subject.relighting.onnx_graph import cpu_session, node, tensor_value
from relit_camera.subject.relighting.relighter import RelighterOptions, weighted_light
from relit_camera.subject.subject import Subject

RANK_STEP = 8
"""Ranks are rounded up to a multiple of this, with zeros: a handful of groups, and a few numbers more."""


MOST_COMPONENTS, MOST_TIMES_CLUSTERS = 64, 3
"""Subjects of so few components are relit by whole pictures of these, where that takes no more than so many times the
bytes of the clusters: those read it at a third of the speed."""


@dataclass(frozen=True)
class RankGroup:
    """Clusters of one rank.

    Attributes:
        clusters: which they are.
        pixels: (clusters, places) int32 row-major.
        values: (clusters, 3, rank, places) int8 or float16.
    """

    clusters: NDArray[np.intp]
    pixels: NDArray[np.int32]
    values: NDArray[Any]


def rounded_ranks(basis: LocalBasis) -> NDArray[np.int32]:
    """The rank (clusters,) that each cluster has in its group."""
    return np.asarray(-(-np.diff(basis.first) // RANK_STEP) * RANK_STEP, np.int32)


def cluster_bytes(basis: LocalBasis) -> int:
    """Bytes of the values and mixes that `ClusterPictures` reads, but for the units of the mixes."""
    codes = 1 if basis.values.dtype == np.int8 else 2
    rows = codes * int(rounded_ranks(basis).sum())
    return rows * int(3 * basis.pixels.shape[1] + basis.components + min(basis.components, HEAD_COLUMNS))


def groups_by_rank(basis: LocalBasis) -> list[RankGroup]:
    """All clusters of a basis, by rising rank."""
    ranks, rounded = np.diff(basis.first), rounded_ranks(basis)
    groups = []
    for rank in np.unique(rounded):
        chosen = np.flatnonzero(rounded == rank)
        grouped = np.zeros((len(chosen), 3, rank, basis.pixels.shape[1]), basis.values.dtype)
        for index, cluster in enumerate(chosen):
            values = basis.values[basis.first[cluster] : basis.first[cluster + 1]]
            grouped[index, :, : ranks[cluster]] = values.transpose(1, 0, 2)
        groups.append(RankGroup(chosen, basis.pixels[chosen], grouped))
    return groups


def mixes_by_rank(basis: LocalBasis, groups: Sequence[RankGroup]) -> Iterator[NDArray[np.float32]]:
    """The mixes (rank, components) of each cluster in `groups`, units of the values included.

    One cluster at a time, because mixes are large as floats.
    """
    for group in groups:
        for cluster in group.clusters:
            mixes = np.zeros((group.values.shape[2], basis.components), np.float32)
            own = basis.scaled_mixes(slice(int(basis.first[cluster]), int(basis.first[cluster + 1])))
            mixes[: len(own)] = own
            yield mixes


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


class ClusterPictures:
    """Local components × the amounts of the shared ones, and in each cluster its pixels × its components.

    Clusters of equal rank are multiplied together.

    Attributes:
        mixes: the product of all clusters' mixes, which the same person in another size may share.
        nbytes: bytes that are read for a picture.
    """

    def __init__(self, basis: LocalBasis, size: int, threads: int, same_mixes: ClusterPictures | None) -> None:
        """For a picture of `size` pixels; those of no cluster come back black. `same_mixes`: whose mixes to use too."""
        basis = in_8_bits(basis)
        groups = groups_by_rank(basis)
        if same_mixes is None:
            rows = int(rounded_ranks(basis).sum())
            self.mixes = IntegerProduct(rows, basis.components, mixes_by_rank(basis, groups), threads)
        else:
            self.mixes = same_mixes.mixes
        self._clusters = ClusterProducts([group.values for group in groups], threads)
        # Where each pixel's red stands among the clusters' products; that of no cluster is behind them. The places of
        # all channels would be three times as large, 6 MB of a picture of 512 × 512.
        self._source = np.full(size, self._clusters.size, np.intp)
        for group, positions in zip(groups, self._clusters.positions(), strict=True):
            self._source[group.pixels] = positions
        self.nbytes = self.mixes.nbytes + self._clusters.nbytes

    def __call__(self, amounts: NDArray[np.float32]) -> NDArray[np.float32]:
        """The picture (count, pixels, 3) for amounts (3, count, components) of each channel's light."""
        count = amounts.shape[1]
        products = self._clusters(self.mixes(amounts.reshape(3 * count, -1)).reshape(3, count, -1))
        pictures = np.empty((count, len(self._source), 3), np.float32)
        for of_light, picture in zip(products, pictures, strict=True):
            # Places beyond the end are clipped to the last product, which is 0.
            planes = [of_light[step:].take(self._source, mode="clip")[None] for step in CHANNEL_STEPS]
            cv2.merge(planes, picture[None])
        return pictures


class BasisRelighter:
    """coefficients × light, and the pictures of the shared components × that, by way of the clusters or, of few, whole.

    Threads may share it.
    """

    name, provider = "basis", "cpu"

    def __init__(
        self, subject: Subject, options: RelighterOptions | None = None, same_mixes: BasisRelighter | None = None
    ) -> None:
        """Prepare the products.

        Args:
            subject: the person.
            options: only the number of threads is used; it always runs on the CPU.
            same_mixes: a relighter of 8-bit bases with the same coefficients and mixes, those of the same person in
                another size: its products with them, which have most of the bytes, are used here too.
        """
        threads = (options or RelighterOptions()).session.threads
        basis, size = subject.basis, subject.matte.size
        self._shape = (subject.metadata.height, subject.metadata.width)
        self._coefficient_bytes = subject.coefficients.nbytes
        if same_mixes is None:
            self._coefficient_product = _coefficient_session(subject.coefficients, threads)
        else:
            self._coefficient_product = same_mixes._coefficient_product
        other = None if same_mixes is None else same_mixes._pictures
        self._pictures: ComponentPictures | ClusterPictures
        if _pictures_are_better(basis):
            self._pictures = ComponentPictures(basis, size, threads)
        else:
            self._pictures = ClusterPictures(
                basis, size, threads, other if isinstance(other, ClusterPictures) else None
            )

    @property
    def nbytes(self) -> int:
        """Bytes that are read for a picture."""
        return self._coefficient_bytes + self._pictures.nbytes

    def relight(self, light_maps: NDArray[np.float32]) -> NDArray[np.float32]:
        """See `Relighter.relight`."""
        count = len(light_maps)
        light = weighted_light(light_maps).transpose(2, 0, 1).reshape(3 * count, -1)
        amounts = self._coefficient_product.run({"light": light})["amounts"].reshape(3, count, -1)
        return self._pictures(amounts).reshape(count, *self._shape, 3)


def _pictures_are_better(basis: LocalBasis) -> bool:
    """Whether whole pictures of the components take less time, and not many times the memory."""
    return basis.components <= MOST_COMPONENTS and component_bytes(basis) <= MOST_TIMES_CLUSTERS * cluster_bytes(basis)


def _coefficient_session(coefficients: NDArray[np.float32], threads: int) -> Session:
    """`light` (count, texels) → `amounts` (count, components).

    In a fourth of the time that NumPy takes, which reorders the matrix at each product.
    """
    components, texels = coefficients.shape
    nodes = [node("MatMul", ["light", "coefficients"], ["amounts"])]
    light = tensor_value("light", "float32", ["count", texels])
    amounts = tensor_value("amounts", "float32", ["count", components])
    constants = {"coefficients": np.ascontiguousarray(coefficients.T)}
    return cpu_session("relight-coefficients", nodes, [light], [amounts], constants, threads)
