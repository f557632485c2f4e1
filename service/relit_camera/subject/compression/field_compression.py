"""Compressing any reflectance field into local bases that are as large as the accuracy target requires.

Every column of the field, a texel of the light map or a captured light, is divided by the error allowed in it. A
cluster of pixels keeps the principal components that explain more than a threshold; the threshold is found on a sample
of clusters, so that the worst column stays within its allowed error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.images.image_types import Mask
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.compression.column_peaks import light_peaks, texel_peaks
from relit_camera.subject.compression.compression_quality import (
    CompressionQuality,
    dense_bytes,
    worst_light_db,
    worst_map_db,
    worst_texel_db,
)
from relit_camera.subject.compression.field_tiles import FieldRowReader, distinct_inside, tiles
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.compression.principal_components import ClusterComponents, PixelCluster, fit_shared_basis
from relit_camera.subject.reflectance_field import TEXELS, ReflectanceField

Values = NDArray[np.float32]

SAMPLE_CLUSTERS = 64
"""Number of clusters from which the threshold is found."""
CLUSTER_ERROR_SHARE, SHARED_BASIS_ERROR_SHARE = 0.55, 0.35
"""Shares of the allowed squared error for the clusters' components and for the shared basis; the rest is a reserve for
what the sample misses."""
THRESHOLD_RANGE, FIRST_THRESHOLD = (1e-2, 1e6), 3e3
"""Range in which the threshold is searched, and where: most faces have one of a few thousand."""
LEAST_POWER = 0.01
"""Of the threshold by which the error grows: where it is less, 8 bits do not allow what is asked."""
LEAST_OF_ALLOWED = 0.98
"""Share of the allowed error with which a threshold is taken without looking for a larger one."""
MOST_STEPS = 12
"""Thresholds that are tried at most; two to six are enough where the error grows as smoothly as it should."""


@dataclass(frozen=True)
class CompressedField:
    """A compressed field: R[p, c, l] = Σ_g row[p, c, g] · coefficients[g, l], with the rows of `basis`.

    Attributes:
        basis: the rows.
        coefficients: (components, 2048) float32.
        light_coefficients: (components, lights) float32: the captured frames in this basis.
        quality: the accuracy reached, and the size.
    """

    basis: LocalBasis
    coefficients: Values
    light_coefficients: Values
    quality: CompressionQuality


def compress_field(
    field: ReflectanceField,
    captured: Values,
    matte: Mask,
    target: CompressionTarget | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CompressedField:
    """The smallest compressed field that returns every texel and every captured light within the target's accuracy.

    The field is read once, tile by tile, and two samples of it before that.

    Args:
        field: any reflectance field.
        captured: (lights, height, width, 3) the pictures that it was built from.
        matte: (height, width), above ½ somewhere; pixels where it is 0 become black.
        target: the accuracy to reach; the default one where None.
        progress: called with the count of tiles done and the total.
    """
    target = target or CompressionTarget()
    rows, work = FieldRowReader(field, captured), tiles(matte)
    inside = matte.ravel() > 0.5
    with worker_pool() as pool:
        peaks = np.concatenate([texel_peaks(field, inside, pool), light_peaks(captured, inside, pool)])
        allowed = target.allowed(peaks)
        threshold = _threshold_from_sample(rows, np.concatenate(work), inside, allowed, pool)
        compress_tile = _TileCompressor(rows, inside, allowed, threshold, target.light)
        done: list[_CompressedTile] = []
        for tile in pool.map(compress_tile, work):
            done.append(tile)
            progress(len(done), len(work))
        components = [each for tile in done for each in tile.components]
        counted = 3 * int(inside.sum())
        shared = fit_shared_basis(components, SHARED_BASIS_ERROR_SHARE * counted)
    error = (np.sum([tile.error for tile in done], axis=0) + shared.error) / counted
    truth = np.zeros((len(target.maps), len(inside), 3), np.float32)
    for tile in done:
        truth[:, tile.pixels] = tile.relit
    basis = _assemble_basis(np.concatenate(work), components, shared.mixes)
    both = shared.vectors * allowed
    coefficients, lights = np.ascontiguousarray(both[:, :TEXELS]), np.ascontiguousarray(both[:, TEXELS:])
    quality = CompressionQuality(
        light_db=worst_light_db(basis, lights, captured, peaks[TEXELS:], matte),
        texel_db=worst_texel_db(basis, coefficients, (error * allowed**2)[:TEXELS], matte),
        map_db=worst_map_db(basis, coefficients, target.light, truth, matte),
        bytes_share=(basis.nbytes + both.nbytes) / dense_bytes(matte),
    )
    return CompressedField(basis, coefficients, lights, quality)


@dataclass(frozen=True)
class _CompressedTile:
    """The components of a tile's clusters, and their error.

    Attributes:
        components: of each of its clusters.
        error: sum of squared residuals (columns,), in units of the allowed error.
        pixels: its pixels (some,), row-major.
        relit: (maps, some, 3) these pixels of the uncompressed field under the target's light maps.
    """

    components: list[ClusterComponents]
    error: NDArray[np.float64]
    pixels: NDArray[np.int32]
    relit: Values


@dataclass(frozen=True)
class _TileCompressor:
    """Reads and compresses one tile; called from several threads."""

    rows: FieldRowReader
    inside: NDArray[np.bool_]
    allowed: Values
    threshold: float
    light: Values

    def __call__(self, tile: NDArray[np.int32]) -> _CompressedTile:
        pixels, places = np.unique(tile, return_inverse=True)
        rows = self.rows.read(pixels)
        relit = np.stack([self.light[:, :, c] @ rows[:, c, :TEXELS].T for c in range(3)], axis=-1)
        rows /= self.allowed
        components, error = [], np.zeros(len(self.allowed))
        for cluster, chosen in zip(tile, places.reshape(tile.shape), strict=True):
            part = _CountedCluster.of(rows[chosen], cluster, self.inside)
            components.append(part.cluster.components(self.threshold))
            error += part.error(components[-1])
        return _CompressedTile(components, error, pixels, relit)


@dataclass(frozen=True)
class _CountedCluster:
    """A cluster, and the mask of its rows that count for the error."""

    cluster: PixelCluster
    counted: NDArray[np.bool_]

    @staticmethod
    def of(rows: Values, pixels: NDArray[np.int32], inside: NDArray[np.bool_]) -> _CountedCluster:
        """The cluster of rows (pixels, 3, columns), whose channels become rows of their own."""
        by_channel = rows.transpose(1, 0, 2).reshape(-1, rows.shape[2])
        return _CountedCluster(PixelCluster(by_channel), np.tile(distinct_inside(pixels, inside), 3))

    def error(self, components: ClusterComponents) -> NDArray[np.float64]:
        """Sum of squared residuals (columns,) of the rows that count."""
        residual = (self.cluster.rows - components.restored())[self.counted]
        return np.asarray(np.einsum("rc,rc->c", residual, residual), np.float64)


def _threshold_from_sample(
    rows: FieldRowReader,
    clusters: NDArray[np.int32],
    inside: NDArray[np.bool_],
    allowed: Values,
    pool: ThreadPoolExecutor,
) -> float:
    """The threshold that keeps to the error `allowed` in each column (columns,), from a sample of clusters."""
    parts, count = [], 0
    counted = clusters[inside[clusters].any(axis=1)]
    for cluster in counted[:: -(-len(counted) // SAMPLE_CLUSTERS)]:
        pixels, places = np.unique(cluster, return_inverse=True)
        part = _CountedCluster.of(rows.read(pixels)[places], cluster, inside)
        part.cluster.rows[:] /= allowed
        count += int(part.counted.sum())
        parts.append(part)

    def worst(threshold: float) -> float:
        errors = pool.map(lambda part: part.error(part.cluster.components(threshold)), parts)
        return float(np.sum(list(errors), axis=0).max()) / count

    return _largest_threshold(worst, CLUSTER_ERROR_SHARE)


def _largest_threshold(error: Callable[[float], float], allowed: float) -> float:
    """The largest threshold whose error, which grows with it, is allowed, or one with nearly that error.

    The error is nearly a power of the threshold: each step goes where the power through the last two errors reaches
    what is allowed, if that lies between the thresholds known to be too small and too large, and else between these.
    Where no threshold is small enough it is the least one. (SciPy's root finders begin at both ends of the range, of
    which the lower one costs most, and may end above what is allowed.)
    """
    low, high = np.log(THRESHOLD_RANGE)
    goal = np.log(allowed * (1 + LEAST_OF_ALLOWED) / 2)
    at, power = np.log(FIRST_THRESHOLD), 1.0
    before: tuple[float, float] | None = None
    for _ in range(MOST_STEPS):
        found = error(float(np.exp(at)))
        low, high = (at, high) if found <= allowed else (low, at)
        if LEAST_OF_ALLOWED * allowed <= found <= allowed:
            break
        now = at, float(np.log(max(found, 1e-30)))
        if before is not None:
            power = (now[1] - before[1]) / (now[0] - before[0])
            if found > allowed and power < LEAST_POWER:
                break
        before = now
        step = (goal - now[1]) / power if power > 0 else np.inf
        at = at + step if low < at + step < high else (low + high) / 2
    return float(np.exp(low))


def _assemble_basis(
    pixels: NDArray[np.int32], clusters: Sequence[ClusterComponents], mixes: Sequence[NDArray[np.float16]]
) -> LocalBasis:
    """The local basis of all clusters' pixels (clusters, places), components and mixes."""
    codes = [each.codes.reshape(len(each.codes), 3, -1) for each in clusters]
    return LocalBasis(
        pixels=pixels,
        first=np.cumsum([0, *map(len, codes)], dtype=np.int32),
        values=np.concatenate(codes),
        scales=np.concatenate([each.scales for each in clusters]),
        mixes=np.concatenate(mixes),
    )
