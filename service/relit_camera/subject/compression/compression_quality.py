"""How accurate a compressed field is: PSNR of its worst light, texel and light map against the field it was made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.images.image_quality import PEAK_PERCENT, psnr
from relit_camera.base.images.image_types import Mask
from relit_camera.subject.compression.accuracy_target import DARK_LIGHT_FRACTION
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.reflectance_field import TEXELS

Values = NDArray[np.float32]

MAX_PSNR_DB = 200.0
"""PSNR given for equal pictures."""
PEAK_PIXEL_STRIDE = 4
"""A texel's peak is taken from every fourth pixel."""
LIGHTS_PER_BATCH = 32
"""Lights restored at a time, which bounds the memory."""


@dataclass(frozen=True)
class CompressionQuality:
    """Worst PSNRs in dB (see `base.images.image_quality.psnr`), and the size of a compressed field.

    Attributes:
        light_db: of the least accurate captured light.
        texel_db: of the least accurate single texel.
        map_db: of the least accurate light map of the target; None where it has none.
        bytes_share: bytes of the compressed field over those of the dense float32 matrix.
    """

    light_db: float
    texel_db: float
    map_db: float | None
    bytes_share: float


def dense_bytes(matte: Mask) -> int:
    """Bytes of the uncompressed matrix (pixels, 3, 2048) in float32."""
    return matte.size * 3 * TEXELS * 4


def worst_texel_db(basis: LocalBasis, coefficients: Values, errors: Values, matte: Mask) -> float:
    """Lowest PSNR in dB of the picture under a single texel, inside the matte.

    Its peak, the 99.5th percentile, is taken from the compressed field, at every fourth pixel.

    Args:
        basis: the basis of the compressed field.
        coefficients: (components, 2048).
        errors: (2048,) mean square errors.
        matte: (height, width).
    """
    inside = np.flatnonzero(matte.ravel() > 0.5)[::PEAK_PIXEL_STRIDE]
    peaks = np.empty(TEXELS)
    for start in range(0, TEXELS, LIGHTS_PER_BATCH):
        part = slice(start, start + LIGHTS_PER_BATCH)
        pictures = basis.at(coefficients[:, part], inside)
        peaks[part] = np.percentile(pictures.reshape(len(pictures), -1), PEAK_PERCENT, axis=1)
    reference = np.maximum(peaks, DARK_LIGHT_FRACTION * peaks.max())
    return float(min(-10 * np.log10((errors / reference**2).max() + 1e-20), MAX_PSNR_DB))


def worst_light_db(
    basis: LocalBasis, light_coefficients: Values, captured: Values, peaks: Values, matte: Mask
) -> float:
    """Lowest PSNR in dB of the captured lights' pictures, inside the matte.

    Args:
        basis: the basis of the compressed field.
        light_coefficients: (components, lights).
        captured: (lights, height, width, 3) the captured pictures.
        peaks: (lights,) of these.
        matte: (height, width).
    """
    inside = np.flatnonzero(matte.ravel() > 0.5)
    truth = captured.reshape(len(captured), -1, 3)
    peaks = np.maximum(peaks, DARK_LIGHT_FRACTION * peaks.max())

    def worst_from(start: int) -> float:
        part = slice(start, start + LIGHTS_PER_BATCH)
        restored = basis.at(light_coefficients[:, part], inside)
        pairs = zip(restored, truth[part, inside], peaks[part], strict=True)
        return min(psnr(seen[None], expected[None], peak=float(peak)) for seen, expected, peak in pairs)

    with worker_pool() as pool:
        return min([MAX_PSNR_DB, *pool.map(worst_from, range(0, len(truth), LIGHTS_PER_BATCH))])


def worst_map_db(basis: LocalBasis, coefficients: Values, light: Values, truth: Values, matte: Mask) -> float | None:
    """Lowest PSNR in dB of the pictures under the light maps, inside the matte; None without a map.

    Args:
        basis: the basis of the compressed field.
        coefficients: (components, 2048).
        light: (maps, 2048, 3) radiance times solid angle.
        truth: (maps, height · width, 3), the dense field's pictures.
        matte: (height, width).
    """
    inside = np.flatnonzero(matte.ravel() > 0.5)
    found = []
    for each, expected in zip(light, truth, strict=True):
        by_channel = basis.at(coefficients @ each, inside)
        seen = np.stack([by_channel[channel, :, channel] for channel in range(3)], axis=1)
        found.append(min(psnr(seen[None], expected[None, inside]), MAX_PSNR_DB))
    return min(found, default=None)
