"""A factored field as a few principal pictures, as many as the error asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.space.quality import psnr
from relit_camera.subject.field import FactoredField

TARGET_DB = 50.0
"""Every captured light comes back at least this well: 10 dB above what a person sees in a call."""

BATCH = 32
"""Lights restored at once when the error is measured: bounds the memory."""


@dataclass(frozen=True)
class CompressedField:
    """R[p, c, l] = Σ_k basis[c, k, p] · coefficients[k, l].

    Attributes:
        basis: (3, components, height, width) float16.
        coefficients: (components, 2048) float32.
        light_coefficients: (components, lights) float32: the captured frames in this basis.
        psnr_db: worst over the captured lights, after rounding to float16.
    """

    basis: NDArray[np.float16]
    coefficients: NDArray[np.float32]
    light_coefficients: NDArray[np.float32]
    psnr_db: float


def compress(field: FactoredField, matte: NDArray[np.float32], target_db: float = TARGET_DB) -> CompressedField:
    """The fewest principal pictures that return every captured light at `target_db` or better inside the matte.

    Every light is scaled to the same energy before the principal directions are taken, so that a dim light from
    behind comes back as well, for its own brightness, as a bright one from the front. Lights too dark to have a peak
    of their own are judged by a tenth of the field's. With all components kept the field is exact but for float16.
    """
    lights, height, width, _ = field.pictures.shape
    samples = field.pictures.reshape(lights, -1)
    gram = (samples @ samples.T).astype(np.float64)
    energy = np.diag(gram)
    importance = 1 / np.sqrt(np.maximum(energy, 1e-4 * energy.max()))
    weighted_gram = gram * np.outer(importance, importance)
    eigenvalues, vectors = np.linalg.eigh(weighted_gram)
    order = np.argsort(eigenvalues)[::-1]
    vectors = vectors[:, order]
    peak = float(np.percentile(field.pictures, 99.5))

    low, high, best = 1, lights, None
    while low <= high:
        rank = (low + high) // 2
        candidate = _project(field, vectors[:, :rank], importance, matte, peak, (height, width))
        if candidate.psnr_db >= target_db:
            best, high = candidate, rank - 1
        else:
            low = rank + 1
    return best if best is not None else _project(field, vectors, importance, matte, peak, (height, width))


def _project(
    field: FactoredField,
    vectors: NDArray[np.float64],
    importance: NDArray[np.float64],
    matte: NDArray[np.float32],
    peak: float,
    size: tuple[int, int],
) -> CompressedField:
    lights, rank = vectors.shape
    # picture_n · importance_n ≈ Σ_k component_k · vectors[n, k], component_k = Σ_n vectors[n, k] importance_n picture_n
    analysis = (vectors * importance[:, None]).T.astype(np.float32)
    components = (analysis @ field.pictures.reshape(lights, -1)).reshape(rank, *size, 3)
    scale = np.abs(components).reshape(rank, -1).max(axis=1) + 1e-20
    # Each picture fills float16's exact range; its scale goes into the coefficients.
    basis = (components / scale[:, None, None, None]).transpose(3, 0, 1, 2).astype(np.float16)
    light_coefficients = ((vectors / importance[:, None]).T * scale[:, None]).astype(np.float32)
    return CompressedField(
        basis=np.ascontiguousarray(basis),
        coefficients=light_coefficients @ field.weights,
        light_coefficients=light_coefficients,
        psnr_db=worst_light_db(basis, light_coefficients, field.pictures, matte, peak),
    )


def worst_light_db(
    basis: NDArray[np.float16],
    light_coefficients: NDArray[np.float32],
    captured: NDArray[np.float32],
    matte: NDArray[np.float32],
    peak: float,
) -> float:
    """PSNR in dB of the captured light (lights, height, width, 3) that comes back worst, inside the matte.

    Lights too dark to have a peak of their own are judged by a tenth of the field's `peak`.
    """
    lights, height, width, _ = captured.shape
    rounded = basis.astype(np.float32).transpose(1, 2, 3, 0).reshape(len(light_coefficients), -1)
    worst = np.inf
    for start in range(0, lights, BATCH):
        stop = min(start + BATCH, lights)
        restored = (light_coefficients[:, start:stop].T @ rounded).reshape(-1, height, width, 3)
        for picture, truth in zip(restored, captured[start:stop], strict=True):
            own_peak = float(np.percentile(truth[matte > 0.5], 99.5))
            worst = min(worst, psnr(picture, truth, matte, peak=max(own_peak, 0.1 * peak)))
    return worst
