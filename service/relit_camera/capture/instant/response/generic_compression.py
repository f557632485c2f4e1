"""Compressing a generic head's field (`GenericField`) as it is: it has few terms, and a coarse shape.

`subject.compression.field_compression` reads any field in rows of 2048 texels for each pixel and channel, which takes
a minute. Here the rows of the shape alone, at half resolution, are written in one basis over light; the rows of the
picture are then mixtures of neighbors' rows, by albedo and gloss, in that small space. The result has the same form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.images.image_quality import PEAK_PERCENT, psnr
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.instant.response.generic_reflectance import GenericField
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.compression.compression_quality import CompressionQuality, dense_bytes
from relit_camera.subject.compression.field_tiles import tiles
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.compression.principal_components import MAX_CODE


@dataclass(frozen=True)
class GenericCompressionTunables:
    """Constants of the compression.

    Attributes:
        components: of the basis over light.
        power_rounds: of the randomized range finder (Halko, Martinsson and Tropp 2011).
        sample_rows: rows of the shape from which the basis is found.
        cluster_error: mean square error that a cluster may have, in units of the allowed error of a texel.
        measured_pixels: of the picture from which the accuracy under single texels is measured.
    """

    components: int = 128
    power_rounds: int = 1
    sample_rows: int = 2500
    cluster_error: float = 0.25
    measured_pixels: int = 1500


TUNABLES = GenericCompressionTunables()
TEXELS_PER_BATCH = 256
"""Texels whose accuracy is measured at a time."""


@dataclass(frozen=True)
class CompressedGeneric:
    """A compressed field, as `subject.compression.field_compression.CompressedField` has it.

    Attributes:
        basis: the rows.
        coefficients: (components, 2048) float32.
        quality: the accuracy reached, and the size; that of captured lights is left to the caller.
    """

    basis: LocalBasis
    coefficients: Float32Array
    quality: CompressionQuality


def compress_generic_field(field: GenericField, matte: Mask, target: CompressionTarget) -> CompressedGeneric:
    """The field in local bases; pixels where the matte (height, width) is 0 become black."""
    response = field.response
    inside = matte.ravel() > 0.5
    mean = np.float32(field.albedo.reshape(-1, 3)[inside].mean())
    allowed = _allowed(field, target)
    stride = max(1, 2 * len(response.pixels) // TUNABLES.sample_rows)
    sample = np.concatenate([mean * response.diffuse[::stride], response.glossy[stride // 2 :: stride]])
    vectors = _range_of(np.asarray(sample / allowed, np.float32))
    # The division is moved to the vectors, which are few.
    projection = np.ascontiguousarray((vectors / allowed).T, np.float32)
    diffuse, glossy = (response.spread(each @ projection) for each in (response.diffuse, response.glossy))
    clusters = np.concatenate(tiles(matte))
    rows = _Rows(field, diffuse, glossy)
    with worker_pool() as pool:
        parts = list(pool.map(rows.components, clusters))
    basis = LocalBasis(
        pixels=clusters,
        first=np.cumsum([0, *(len(part.scales) for part in parts)], dtype=np.int32),
        values=np.concatenate([part.codes for part in parts]),
        scales=np.concatenate([part.scales for part in parts]),
        mixes=np.concatenate([part.vectors for part in parts]),
    )
    coefficients = np.ascontiguousarray(vectors * allowed)
    texel_db = target.texel_db + _texel_db(field, basis, coefficients, allowed, inside)
    map_db = _map_db(field, basis, coefficients, matte, target)
    share = (basis.nbytes + coefficients.nbytes) / dense_bytes(matte)
    return CompressedGeneric(basis, coefficients, CompressionQuality(map_db or texel_db, texel_db, map_db, share))


def _allowed(field: GenericField, target: CompressionTarget) -> Float32Array:
    """The root mean square error (2048,) that is allowed under each texel."""
    response = field.response
    some = slice(None, None, max(1, len(response.pixels) // 2000))
    bright = float(np.percentile(field.albedo, 95))
    peaks = np.percentile(bright * response.diffuse[some] + response.glossy[some], PEAK_PERCENT, axis=0)
    return target.allowed(peaks)


def _range_of(rows: Float32Array) -> Float32Array:
    """Orthonormal vectors (components, columns) that nearly span the rows (count, columns), by falling energy."""
    count = min(TUNABLES.components, *rows.shape)
    mixed = rows.T @ np.random.default_rng(0).standard_normal((len(rows), count + 16), np.float32)
    for _ in range(TUNABLES.power_rounds):
        mixed = rows.T @ (rows @ np.linalg.qr(mixed)[0])
    span = np.linalg.qr(mixed)[0]
    gram = (rows @ span).astype(np.float64)
    _, directions = np.linalg.eigh(gram.T @ gram)
    return np.ascontiguousarray((span @ directions[:, ::-1][:, :count]).T, np.float32)


@dataclass(frozen=True)
class _QuantizedCluster:
    """As `ClusterComponents`: codes (count, 3, places) int8, scales (count,), vectors (count, components) float16."""

    codes: NDArray[np.int8]
    scales: Float32Array
    vectors: NDArray[np.float16]


@dataclass(frozen=True)
class _Rows:
    """Rows of the picture's pixels in the basis over light: albedo · diffuse + gloss · glossy."""

    field: GenericField
    diffuse: Float32Array
    glossy: Float32Array

    def components(self, cluster: NDArray[np.int32]) -> _QuantizedCluster:
        """The principal components of a cluster's pixels (places,)."""
        diffuse, glossy = self.diffuse[cluster], self.glossy[cluster]
        albedo, gloss = self.field.albedo.reshape(-1, 3)[cluster], self.field.gloss.ravel()[cluster]
        # Every second pixel in both directions is a pixel of the shape; those between are mixtures.
        level = np.sqrt((albedo**2).sum(axis=1, keepdims=True))
        spanning = np.concatenate([(level * diffuse)[::2], (gloss[:, None] * np.sqrt(3) * glossy)[::2]])
        _, lengths, directions = np.linalg.svd(spanning, full_matrices=False)
        lost = 2 * np.cumsum(lengths[::-1] ** 2)[::-1] / (3 * len(cluster))
        count = max(1, int((lost > TUNABLES.cluster_error).sum()))
        vectors = directions[:count]
        amounts = albedo.T[:, :, None] * (diffuse @ vectors.T) + (gloss[:, None] * (glossy @ vectors.T))[None]
        residual = np.ascontiguousarray(np.moveaxis(amounts, 2, 0))  # (count, 3, places)
        allowed = TUNABLES.cluster_error * residual[0].size / max(count, 1)
        codes, scales, used = [], [], []
        chosen = np.arange(count)
        while len(chosen):
            scale = (np.abs(residual).max(axis=(1, 2)) / MAX_CODE + 1e-30).astype(np.float32)
            code = np.rint(residual / scale[:, None, None])
            codes.append(code.astype(np.int8))
            scales.append(scale)
            used.append(chosen)
            residual = residual - code * scale[:, None, None]
            again = np.einsum("jcp,jcp->j", residual, residual) > allowed
            residual, chosen = residual[again], chosen[again]
        order = np.concatenate(used)
        return _QuantizedCluster(np.concatenate(codes), np.concatenate(scales), vectors[order].astype(np.float16))


def _texel_db(
    field: GenericField, basis: LocalBasis, coefficients: Float32Array, allowed: Float32Array, inside: NDArray[np.bool_]
) -> float:
    """Lowest PSNR in dB of the picture under a single texel, on some pixels; see `CompressionTarget.allowed`."""
    pixels = np.flatnonzero(inside)
    pixels = pixels[:: max(1, len(pixels) // TUNABLES.measured_pixels)]

    def worst_of(start: int) -> float:
        part = slice(start, start + TEXELS_PER_BATCH)
        seen = basis.at(np.ascontiguousarray(coefficients[:, part]), pixels)
        error = ((seen - field.rows(pixels, part).transpose(1, 0, 2)) ** 2).mean(axis=(1, 2))
        return float((-10 * np.log10(error / allowed[part] ** 2 + 1e-20)).min())

    with worker_pool() as pool:
        return min(pool.map(worst_of, range(0, coefficients.shape[1], TEXELS_PER_BATCH)))


def _map_db(
    field: GenericField, basis: LocalBasis, coefficients: Float32Array, matte: Mask, target: CompressionTarget
) -> float | None:
    """Lowest PSNR in dB of the pictures under the target's light maps."""
    pixels = np.flatnonzero(matte.ravel() > 0.5)
    found = []
    lights = target.light if target.maps else np.empty((0, 0, 3), np.float32)
    for light, truth in zip(lights, field.pictures(lights), strict=True):
        by_channel = basis.at(coefficients @ light, pixels)
        seen = np.stack([by_channel[channel, :, channel] for channel in range(3)], axis=1)
        found.append(psnr(seen[None], truth.reshape(-1, 3)[pixels][None]))
    return min(found, default=None)
