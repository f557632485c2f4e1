"""Any reflectance field in few numbers: local bases, as large as the error asks for.

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

from relit_camera.cores import workers
from relit_camera.space.images import Mask
from relit_camera.subject.cluster import Cluster, Components
from relit_camera.subject.field import TEXELS, ReflectanceField
from relit_camera.subject.local_basis import LocalBasis
from relit_camera.subject.reached import Reached, dense_bytes, worst_light_db, worst_map_db, worst_texel_db
from relit_camera.subject.shared_basis import share
from relit_camera.subject.target import Target
from relit_camera.subject.tiles import FieldRows, counted_places, tiles

Values = NDArray[np.float32]

SAMPLE = 64
"""Clusters on which peaks and threshold are found."""
OF_CLUSTERS, OF_SHARED = 0.55, 0.35
"""Shares of the error for the clusters' components and for the shared basis; the rest is for what the sample misses."""
THRESHOLDS = (1e-2, 1e6)
STEPS = 10
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
    reached: Reached


def compress(
    field: ReflectanceField,
    captured: Values,
    matte: Mask,
    target: Target | None = None,
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
    target = target or Target()
    rows, work = FieldRows(field, captured), tiles(matte)
    inside = matte.ravel() > 0.5
    with workers() as pool:
        allowed, threshold = _sampled(rows, np.concatenate(work), inside, target, pool)
        press = _Press(rows, inside, allowed, threshold, target.light)
        done: list[_Pressed] = []
        for tile in pool.map(press, work):
            done.append(tile)
            progress(len(done), len(work))
        components = [each for tile in done for each in tile.components]
        counted = 3 * int(inside.sum())
        shared = share(components, OF_SHARED * counted)
    error = (np.sum([tile.error for tile in done], axis=0) + shared.error) / counted
    truth = np.zeros((len(target.maps), len(inside), 3), np.float32)
    for tile in done:
        truth[:, tile.pixels] = tile.relit
    basis = _joined(np.concatenate(work), components, shared.mixes)
    both = shared.vectors * allowed
    coefficients, lights = np.ascontiguousarray(both[:, :TEXELS]), np.ascontiguousarray(both[:, TEXELS:])
    reached = Reached(
        light_db=worst_light_db(basis, lights, captured, matte),
        texel_db=worst_texel_db(basis, coefficients, (error * allowed**2)[:TEXELS], matte),
        map_db=worst_map_db(basis, coefficients, target.light, truth, matte),
        bytes_share=(basis.nbytes + both.nbytes) / dense_bytes(matte),
    )
    return CompressedField(basis, coefficients, lights, reached)


@dataclass(frozen=True)
class _Pressed:
    """A tile, compressed.

    Attributes:
        components: of each of its clusters.
        error: sum of squares (columns,) that they leave, in units of what is allowed.
        pixels: its pixels (some,), row-major.
        relit: those by the field itself, under the target's maps: (maps, some, 3).
    """

    components: list[Components]
    error: NDArray[np.float64]
    pixels: NDArray[np.int32]
    relit: Values


@dataclass(frozen=True)
class _Press:
    rows: FieldRows
    inside: NDArray[np.bool_]
    allowed: Values
    threshold: float
    light: Values

    def __call__(self, tile: NDArray[np.int32]) -> _Pressed:
        pixels, places = np.unique(tile, return_inverse=True)
        rows = self.rows.read(pixels)
        relit = np.stack([self.light[:, :, c] @ rows[:, c, :TEXELS].T for c in range(3)], axis=-1)
        rows /= self.allowed
        components, error = [], np.zeros(len(self.allowed))
        for cluster, chosen in zip(tile, places.reshape(tile.shape), strict=True):
            part = _Part.of(rows[chosen], cluster, self.inside)
            components.append(part.cluster.components(self.threshold))
            error += part.error(components[-1])
        return _Pressed(components, error, pixels, relit)


@dataclass(frozen=True)
class _Part:
    """A cluster, and which of its rows count."""

    cluster: Cluster
    counted: NDArray[np.bool_]

    @staticmethod
    def of(rows: Values, pixels: NDArray[np.int32], inside: NDArray[np.bool_]) -> _Part:
        """Of rows (places, 3, columns): channel by channel from here on."""
        by_channel = rows.transpose(1, 0, 2).reshape(-1, rows.shape[2])
        return _Part(Cluster(by_channel), np.tile(counted_places(pixels, inside), 3))

    def error(self, components: Components) -> NDArray[np.float64]:
        """Sum of squares (columns,) that the components leave of the rows that count."""
        left = (self.cluster.rows - components.restored())[self.counted]
        return np.asarray(np.einsum("rc,rc->c", left, left), np.float64)


def _sampled(
    rows: FieldRows, clusters: NDArray[np.int32], inside: NDArray[np.bool_], target: Target, pool: ThreadPoolExecutor
) -> tuple[Values, float]:
    """What error is allowed in each column (columns,), and the threshold that keeps to it, by a sample of clusters."""
    parts = []
    telling = clusters[inside[clusters].any(axis=1)]
    for cluster in telling[:: -(-len(telling) // SAMPLE)]:
        pixels, places = np.unique(cluster, return_inverse=True)
        parts.append(_Part.of(rows.read(pixels)[places], cluster, inside))
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

    low, high = np.log(THRESHOLDS)
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if worst(np.exp(middle)) <= OF_CLUSTERS else (low, middle)
    return allowed, float(np.exp(low))


def _joined(
    pixels: NDArray[np.int32], clusters: Sequence[Components], mixes: Sequence[NDArray[np.float16]]
) -> LocalBasis:
    codes = [each.codes.reshape(len(each.codes), 3, -1) for each in clusters]
    return LocalBasis(
        pixels=pixels,
        first=np.cumsum([0, *map(len, codes)], dtype=np.int32),
        values=np.concatenate(codes),
        scales=np.concatenate([each.scales for each in clusters]),
        mixes=np.concatenate(mixes),
    )
