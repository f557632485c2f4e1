"""A field read in tiles, and the tiles cut into clusters of neighbouring pixels.

Any reflectance field in few numbers: local bases, as large as the error asks for.

Every column of the field, a texel of the light map or a captured light, is divided by the error that is allowed in it.
A cluster of pixels keeps the components that explain more than a threshold; the threshold is found on a sample of
clusters, so that the worst column is within what is allowed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask
from relit_camera.base.threads import worker_pool
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.compression.compression_quality import (
    CompressionQuality,
    dense_bytes,
    worst_light_db,
    worst_map_db,
    worst_texel_db,
)
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.compression.principal_components import ClusterComponents, PixelCluster, fit_shared_basis
from relit_camera.subject.reflectance_field import TEXELS, ReflectanceField

TILE_HEIGHT, TILE_WIDTH = 8, 256
"""Pixels read together: 57 MB of rows at 250 lights."""
CLUSTER_PIXELS = 128
"""Pixels of a cluster, about 8 × 16. Larger ones need more components, smaller ones spend more on describing them."""


@dataclass(frozen=True)
class FieldRowReader:
    """What pixels answer to all texels of a light map and, after them, to the captured lights.

    Attributes:
        field: the field.
        captured: (lights, height, width, 3) the pictures that it was built from.
    """

    field: ReflectanceField
    captured: NDArray[np.float32]

    def read(self, pixels: NDArray[np.integer]) -> NDArray[np.float32]:
        """Rows (some, 3, 2048 + lights) of ascending row-major pixels (some,)."""
        lights, _, width, _ = self.captured.shape
        rows = np.empty((len(pixels), 3, TEXELS + lights), np.float32)
        # Only what lies in one line of the picture is read in one go: what is between lines is no neighbour.
        for line in np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(pixels // width)) + 1):
            start, stop = int(pixels[line[0]]), int(pixels[line[-1]]) + 1
            rows[line, :, :TEXELS] = self.field.dense(start, stop)[pixels[line] - start].transpose(0, 2, 1)
        rows[:, :, TEXELS:] = self.captured.reshape(lights, -1, 3)[:, pixels].transpose(1, 2, 0)
        return rows


def tiles(matte: Mask) -> list[NDArray[np.int32]]:
    """The pixels where the matte is not 0, tile by tile, as clusters (count, PLACES) of row-major indices.

    Where a cluster has fewer pixels, its last one is repeated.
    """
    height, width = matte.shape
    found = []
    for top in range(0, height, TILE_HEIGHT):
        for left in range(0, width, TILE_WIDTH):
            # Column by column: consecutive pixels then lie in a block.
            columns, rows = np.nonzero(matte[top : top + TILE_HEIGHT, left : left + TILE_WIDTH].T > 0)
            if len(rows):
                found.append(_split_into_clusters(((top + rows) * width + left + columns).astype(np.int32)))
    return found


def _split_into_clusters(pixels: NDArray[np.int32]) -> NDArray[np.int32]:
    parts = np.array_split(pixels, -(-len(pixels) // CLUSTER_PIXELS))
    return np.stack([np.pad(part, (0, CLUSTER_PIXELS - len(part)), mode="edge") for part in parts])


def distinct_inside(cluster: NDArray[np.int32], inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which places (PLACES,) of a cluster count: pixels inside, given for all (pixels,), and no repeated ones."""
    again = np.zeros(len(cluster), bool)
    again[1:] = cluster[1:] == cluster[:-1]
    return inside[cluster] & ~again


Values = NDArray[np.float32]

SAMPLE_CLUSTERS = 64
"""Clusters on which peaks and threshold are found."""
CLUSTER_ERROR_SHARE, SHARED_BASIS_ERROR_SHARE = 0.55, 0.35
"""Shares of the error for the clusters' components and for the shared basis; the rest is for what the sample misses."""
THRESHOLD_RANGE = (1e-2, 1e6)
BISECTION_STEPS = 10
"""Bisections between them, to 2 %."""


@dataclass(frozen=True)
class CompressedField:
    """R[p, c, l] = Σ_g row[p, c, g] · coefficients[g, l], with the rows of `basis`.

    Attributes:
        basis: the rows.
        coefficients: (components, 2048) float32.
        light_coefficients: (components, lights) float32: the captured frames in this basis.
        reached: how well.
    """

    basis: LocalBasis
    coefficients: Values
    light_coefficients: Values
    reached: CompressionQuality


def compress_field(
    field: ReflectanceField,
    captured: Values,
    matte: Mask,
    target: CompressionTarget | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CompressedField:
    """As few numbers as return every texel and every captured light as well as asked.

    The field is read once, tile by tile, and a sample of it before.

    Args:
        field: any.
        captured: (lights, height, width, 3) the pictures that it was built from.
        matte: (height, width), over ½ somewhere; pixels where it is 0 become black.
        target: what is asked.
        progress: called with the count of tiles done and the total.
    """
    target = target or CompressionTarget()
    rows, work = FieldRowReader(field, captured), tiles(matte)
    inside = matte.ravel() > 0.5
    with worker_pool() as pool:
        allowed, threshold = _threshold_from_sample(rows, np.concatenate(work), inside, target, pool)
        press = _TileCompressor(rows, inside, allowed, threshold, target.light)
        done: list[_CompressedTile] = []
        for tile in pool.map(press, work):
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
    reached = CompressionQuality(
        light_db=worst_light_db(basis, lights, captured, matte),
        texel_db=worst_texel_db(basis, coefficients, (error * allowed**2)[:TEXELS], matte),
        map_db=worst_map_db(basis, coefficients, target.light, truth, matte),
        bytes_share=(basis.nbytes + both.nbytes) / dense_bytes(matte),
    )
    return CompressedField(basis, coefficients, lights, reached)


@dataclass(frozen=True)
class _CompressedTile:
    """A tile, compressed.

    Attributes:
        components: of each of its clusters.
        error: sum of squares (columns,) that they leave, in units of what is allowed.
        pixels: its pixels (some,), row-major.
        relit: those by the field itself, under the target's maps: (maps, some, 3).
    """

    components: list[ClusterComponents]
    error: NDArray[np.float64]
    pixels: NDArray[np.int32]
    relit: Values


@dataclass(frozen=True)
class _TileCompressor:
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
    """A cluster, and which of its rows count."""

    cluster: PixelCluster
    counted: NDArray[np.bool_]

    @staticmethod
    def of(rows: Values, pixels: NDArray[np.int32], inside: NDArray[np.bool_]) -> _CountedCluster:
        """Of rows (places, 3, columns): channel by channel from here on."""
        by_channel = rows.transpose(1, 0, 2).reshape(-1, rows.shape[2])
        return _CountedCluster(PixelCluster(by_channel), np.tile(distinct_inside(pixels, inside), 3))

    def error(self, components: ClusterComponents) -> NDArray[np.float64]:
        """Sum of squares (columns,) that the components leave of the rows that count."""
        left = (self.cluster.rows - components.restored())[self.counted]
        return np.asarray(np.einsum("rc,rc->c", left, left), np.float64)


def _threshold_from_sample(
    rows: FieldRowReader,
    clusters: NDArray[np.int32],
    inside: NDArray[np.bool_],
    target: CompressionTarget,
    pool: ThreadPoolExecutor,
) -> tuple[Values, float]:
    """What error is allowed in each column (columns,), and the threshold that keeps to it, by a sample of clusters."""
    parts = []
    telling = clusters[inside[clusters].any(axis=1)]
    for cluster in telling[:: -(-len(telling) // SAMPLE_CLUSTERS)]:
        pixels, places = np.unique(cluster, return_inverse=True)
        parts.append(_CountedCluster.of(rows.read(pixels)[places], cluster, inside))
    # Of one cluster there is one half.
    halves = [
        np.concatenate([part.cluster.rows[part.counted] for part in half]) for half in (parts[::2], parts[1::2]) if half
    ]
    # What is bright under a light from behind is a rim, which a sample may have too much of: the lower of two counts.
    peaks = [np.percentile(half, 99.5, axis=0) for half in halves]
    allowed = target.allowed(np.min(peaks, axis=0))
    count = sum(map(len, halves))
    del halves
    for part in parts:
        part.cluster.rows[:] /= allowed

    def worst(threshold: float) -> float:
        errors = pool.map(lambda part: part.error(part.cluster.components(threshold)), parts)
        return float(np.sum(list(errors), axis=0).max()) / count

    low, high = np.log(THRESHOLD_RANGE)
    for _ in range(BISECTION_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if worst(np.exp(middle)) <= CLUSTER_ERROR_SHARE else (low, middle)
    return allowed, float(np.exp(low))


def _assemble_basis(
    pixels: NDArray[np.int32], clusters: Sequence[ClusterComponents], mixes: Sequence[NDArray[np.float16]]
) -> LocalBasis:
    codes = [each.codes.reshape(len(each.codes), 3, -1) for each in clusters]
    return LocalBasis(
        pixels=pixels,
        first=np.cumsum([0, *map(len, codes)], dtype=np.int32),
        values=np.concatenate(codes),
        scales=np.concatenate([each.scales for each in clusters]),
        mixes=np.concatenate(mixes),
    )
