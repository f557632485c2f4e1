"""Any field as a few principal pictures, found from a part of its pixels.

A field that is not factored has no captured pictures to take them from, and is too large to hold. Its principal
directions, over texels and captured lights together, are those of a sample of pixels; the others are projected onto
them, a block at a time.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from relit_camera.subject.compress import TARGET_DB, CompressedField, worst_light_db
from relit_camera.subject.field import TEXELS, ReflectanceField

Values = NDArray[np.float32]

RUN = 64
"""Neighbouring pixels that are read together."""
SAMPLE = 4096
"""Pixels whose principal directions serve all."""
MAX_COMPONENTS = 160
"""How many are kept at most, whatever the error: 250 MB at 512 x 512."""


def compress_dense(
    field: ReflectanceField, captured: Values, matte: NDArray[np.float32], target_db: float = TARGET_DB
) -> CompressedField:
    """The fewest principal pictures that return every captured light at `target_db` inside the matte, up to a limit.

    Args:
        field: any.
        captured: (lights, height, width, 3) the pictures that it was built from.
        matte: (height, width); pixels where it is 0 become black.
        target_db: as `compress.compress`, for the pixels sampled.
    """
    inside = matte.ravel() > 0
    flat = captured.reshape(len(captured), -1, 3)
    starts = [start for start in range(0, len(inside), RUN) if inside[start : start + RUN].any()]
    chosen = starts[:: max(1, len(starts) * RUN // SAMPLE)]
    sample = np.concatenate([rows for _, rows in _rows(field, flat, inside, chosen)])
    energy = np.einsum("rc,rc->c", sample, sample)
    importance = 1 / np.sqrt(np.maximum(energy, 1e-4 * energy.max()))
    # Captured lights, which are known, count together as much as all texels, which are guessed from them.
    importance[TEXELS:] *= np.sqrt(TEXELS / len(captured))
    directions = _principal_directions(sample * importance)
    rank = _rank(sample[:, TEXELS:], sample * importance, directions, importance[TEXELS:], target_db)
    directions = directions[:, :rank]
    basis = np.zeros((3, rank, len(inside)), np.float16)
    scale = np.sqrt(np.mean((sample * importance @ directions) ** 2, axis=0)) + 1e-20
    for pixels, rows in _rows(field, flat, inside, starts):
        projected = (rows * importance) @ (directions / scale)
        basis[:, :, pixels] = projected.reshape(-1, 3, rank).transpose(1, 2, 0)
    shaped = basis.reshape(3, rank, *matte.shape)
    coefficients = ((directions * scale).T / importance).astype(np.float32)
    lights = np.ascontiguousarray(coefficients[:, TEXELS:])
    return CompressedField(
        basis=shaped,
        coefficients=np.ascontiguousarray(coefficients[:, :TEXELS]),
        light_coefficients=lights,
        psnr_db=worst_light_db(shaped, lights, captured, matte, float(np.percentile(captured, 99.5))),
    )


def _rows(
    field: ReflectanceField, captured: Values, inside: NDArray[np.bool_], starts: list[int]
) -> Iterator[tuple[NDArray[np.intp], Values]]:
    """Pixels (some,) inside and their rows (3 · some, 2048 + lights), a row a channel, of each run of pixels."""
    for start in starts:
        stop = min(start + RUN, len(inside))
        pixels = start + np.flatnonzero(inside[start:stop])
        dense = field.dense(start, stop)[pixels - start]
        both = np.concatenate([dense, captured[:, pixels].transpose(1, 0, 2)], axis=1)
        yield pixels, both.transpose(0, 2, 1).reshape(3 * len(pixels), -1)


def _principal_directions(rows: Values) -> Values:
    """The principal directions (columns, some) of rows (count, columns), the first ones first."""
    gram = (rows.T @ rows).astype(np.float64)
    count = len(gram)
    _, vectors = eigh(gram, subset_by_index=(max(0, count - MAX_COMPONENTS), count - 1))
    return np.ascontiguousarray(vectors[:, ::-1], np.float32)


def _rank(captured: Values, rows: Values, directions: Values, importance: Values, target_db: float) -> int:
    """How many directions return every column of `captured` (count, lights) at `target_db`, by this sample."""
    amounts = rows @ directions
    peak = float(np.percentile(captured, 99.5))
    peaks = np.maximum(np.percentile(captured, 99.5, axis=0), 0.1 * peak)

    def reached(rank: int) -> bool:
        restored = amounts[:, :rank] @ (directions[TEXELS:, :rank].T / importance)
        error = np.mean((restored - captured) ** 2, axis=0) / peaks**2
        return bool(-10 * np.log10(max(float(error.max()), 1e-30)) >= target_db)

    low, high = 1, directions.shape[1]
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if reached(middle) else (middle + 1, high)
    return low
