"""The local basis of a compressed field: each cluster of pixels has a few basis pictures of its own.

Clustered principal components (Sloan et al., Clustered Principal Components for Precomputed Radiance Transfer,
SIGGRAPH 2003): neighbouring pixels have the same shadows, so one or two dozen components describe a cluster as well
as hundreds describe the whole picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask

_GATHERED_NUMBERS = 4 << 20
"""Values that are read at a time for sums of rows: 16 MB as floats."""


@dataclass(frozen=True)
class LocalBasis:
    """Rows of a field in a basis that all pixels share: row[p, c, g] = Σ_j values[j, c, p] · scales[j] · mixes[j, g].

    The sum goes over the components j of the cluster that pixel p belongs to. Pixels of no cluster are black.

    Attributes:
        pixels: (clusters, places) int32 row-major pixel of each place; where a cluster has fewer, one is repeated.
        first: (clusters + 1,) int32: components first[i] to first[i + 1] are those of cluster i.
        values: (count, 3, places) int8 or float16, of all clusters' components.
        scales: (count,) float32.
        mixes: (count, components) float16: each local component in the shared basis.
    """

    pixels: NDArray[np.int32]
    first: NDArray[np.int32]
    values: NDArray[np.int8] | NDArray[np.float16]
    scales: NDArray[np.float32]
    mixes: NDArray[np.float16]

    def __post_init__(self) -> None:
        """Check that the arrays fit together.

        Raises:
            ValueError: they do not; the message says how.
        """
        count = len(self.values)
        if self.pixels.size == 0:
            raise ValueError("there is no cluster with a pixel")
        if self.pixels.ndim != 2 or self.values.shape[1:] != (3, self.pixels.shape[1]):
            raise ValueError(f"values have shape {self.values.shape} for pixels of shape {self.pixels.shape}")
        if self.scales.shape != (count,) or self.mixes.ndim != 2 or len(self.mixes) != count:
            raise ValueError(f"{count} values, scales of shape {self.scales.shape}, mixes of shape {self.mixes.shape}")
        if self.first.shape != (len(self.pixels) + 1,) or self.first[0] != 0 or self.first[-1] != count:
            raise ValueError(f"the clusters' bounds do not run from 0 to {count}")
        if (np.diff(self.first) < 0).any() or (self.pixels.size and self.pixels.min() < 0):
            raise ValueError("the clusters' bounds fall, or a pixel is negative")

    @property
    def components(self) -> int:
        """Number of components of the shared basis."""
        return int(self.mixes.shape[1])

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(a.nbytes for a in (self.pixels, self.first, self.values, self.scales, self.mixes))

    def has_mixes_of(self, other: LocalBasis) -> bool:
        """Whether components, scales and mixes are the very arrays of another basis."""
        pairs = ((self.first, other.first), (self.scales, other.scales), (self.mixes, other.mixes))
        return all(mine is its for mine, its in pairs)

    def scaled_mixes(self, part: slice = slice(None)) -> NDArray[np.float32]:
        """The mixes times their scales, float32, for a slice of the components."""
        return np.asarray(self.mixes[part].astype(np.float32) * self.scales[part, None])

    def at(self, amounts: NDArray[np.float32], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """Colors (count, some, 3) of distinct row-major pixels (some,), for amounts (components, count)."""
        result = np.zeros((amounts.shape[1], len(pixels), 3), np.float32)
        place = np.full(self._end(pixels), -1, np.intp)
        place[pixels] = np.arange(len(pixels))
        for cluster, part in self._clusters():
            target = place[cluster]
            wanted = np.flatnonzero(target >= 0)
            if len(wanted):
                used = self.values[part][:, :, wanted].astype(np.float32).reshape(-1, 3 * len(wanted))
                mixed = (self.scaled_mixes(part) @ amounts).T @ used
                result[:, target[wanted]] = mixed.reshape(-1, 3, len(wanted)).transpose(0, 2, 1)
        return result

    def rows(self, pixels: NDArray[np.intp], weights: NDArray[np.floating]) -> NDArray[np.float32]:
        """Weighted sums (3, count, components) of rows: of the `pixels` (count, some), by `weights` (count, some)."""
        places = self.pixels.shape[1]
        found = np.full(self._end(pixels), -1, np.intp)
        found[self.pixels.ravel()] = np.arange(self.pixels.size)  # of a repeated pixel the last place
        place = found[pixels.ravel()]
        order = np.argsort(place, kind="stable")
        order = order[np.searchsorted(place[order], 0) :]
        bounds = np.searchsorted(place[order], np.arange(len(self.pixels) + 1) * places)
        result = np.zeros((3, len(pixels), self.components), np.float32)
        for index, (_, part) in enumerate(self._clusters()):
            entries = np.sort(order[bounds[index] : bounds[index + 1]])  # those of one sum beside one another
            if len(entries) and part.stop > part.start:
                touched, starts = np.unique(entries // pixels.shape[1], return_index=True)
                sums = np.empty((part.stop - part.start, 3, len(touched)), np.float32)
                step = max(_GATHERED_NUMBERS // (len(sums) * 3 * pixels.shape[1]), 1)
                for first in range(0, len(touched), step):
                    begin, end = starts[first], np.append(starts, len(entries))[min(first + step, len(starts))]
                    some = entries[begin:end]
                    used = self.values[part][:, :, place[some] - index * places] * weights.ravel()[some].astype(
                        np.float32
                    )
                    sums[:, :, first : first + step] = np.add.reduceat(
                        used, starts[first : first + step] - begin, axis=2, dtype=np.float32
                    )
                result[:, touched] += sums.transpose(1, 2, 0) @ self.scaled_mixes(part)
        return result

    def gram(self) -> NDArray[np.float64]:
        """Inner products (components, components) of the shared basis's pictures, over all pixels and channels."""
        total = np.zeros((self.components, self.components))
        for cluster, part in self._clusters():
            _, places = np.unique(cluster, return_index=True)
            values = self.values[part][:, :, places].astype(np.float32).reshape(-1, 3 * len(places))
            mixes = self.scaled_mixes(part)
            total += mixes.T @ (values @ values.T) @ mixes
        return total

    def _clusters(self) -> Iterator[tuple[NDArray[np.int32], slice]]:
        for index, cluster in enumerate(self.pixels):
            yield cluster, slice(int(self.first[index]), int(self.first[index + 1]))

    def _end(self, pixels: NDArray[np.intp]) -> int:
        return int(max(pixels.max(initial=-1), self.pixels.max(initial=-1))) + 1


def global_basis(pictures: NDArray[np.float16], matte: Mask) -> LocalBasis:
    """A basis of one cluster, all pixels where the matte is not 0, with the shared basis's pictures as they are.

    Args:
        pictures: (3, components, height, width).
        matte: (height, width).
    """
    inside = np.flatnonzero(matte.ravel() > 0)
    components = pictures.shape[1]
    return LocalBasis(
        pixels=inside.astype(np.int32)[None],
        first=np.array([0, components], np.int32),
        values=np.ascontiguousarray(pictures.reshape(3, components, -1)[:, :, inside].transpose(1, 0, 2)),
        scales=np.ones(components, np.float32),
        mixes=np.eye(components, dtype=np.float16),
    )
