"""The patterns that the screen shows: rows of an S-matrix, with black and white between them, and their demultiplexing.

A pattern lights about half of the patches. Half the screen gives eight times the light of one of fifteen patches, so
that the noise of a picture of one patch, demultiplexed from all patterns, is far lower than if it were filmed alone
(Schechner, Nayar and Belhumeur 2007). An S-matrix is a Hadamard matrix without its first row and column.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relit_camera.base.array_types import Float32Array, Float64Array

Pattern = Literal["black", "white"] | Annotated[list[Annotated[float, Field(ge=0, le=1)]], Field(max_length=64)]
"""All black, all white, or the pixel value 0..1 of each patch."""

ORDERS_TRIED = 3000


def check_pattern(pattern: Pattern, patches: int, name: str) -> None:
    """Check that a pattern has one value a patch.

    Raises:
        ValueError: it has not.
    """
    if not isinstance(pattern, str) and len(pattern) != patches:
        raise ValueError(f"{name} has {len(pattern)} values, there are {patches} patches")


def s_matrix(patches: int) -> NDArray[np.int_]:
    """Patterns (rows, patches) of 0 and 1: an S-matrix of the least order that suffices, its first columns."""
    order = next(each for each in range(max(3, patches), 4 * patches + 8) if _has_s_matrix(each))
    if (order + 1) & order == 0:
        # A Hadamard matrix by Sylvester's doubling (1867).
        hadamard = np.ones((1, 1), np.int_)
        while len(hadamard) <= order:
            hadamard = np.block([[hadamard, hadamard], [hadamard, -hadamard]])
        rows = (1 - hadamard[1:, 1:]) // 2
    else:
        # The quadratic residues of a prime 3 modulo 4 (Paley 1933).
        residues = {k * k % order for k in range(order)}
        first = np.array([int(k in residues) for k in range(order)])
        rows = np.stack([np.roll(first, k) for k in range(order)])
    return np.asarray(rows[:, :patches], np.int_)


def _has_s_matrix(order: int) -> bool:
    prime = order > 2 and all(order % k for k in range(2, int(order**0.5) + 1))
    return (order + 1) & order == 0 or (prime and order % 4 == 3)


def standard_sequence(columns: int, rows: int, one_by_one: bool = False) -> list[Pattern]:
    """Black, white and black before, amid and after the patterns of an S-matrix, or of one patch at a time.

    White tells where the face is and how bright; the same white later on tells whether anything drifted.
    """
    chosen = np.eye(columns * rows, dtype=np.int_) if one_by_one else _distinct_patterns(columns, rows)
    patterns: list[Pattern] = [[float(value) for value in row] for row in chosen]
    middle = len(patterns) // 2
    frame: list[Pattern] = ["black", "white", "black"]
    return [*frame, *patterns[:middle], *frame, *patterns[middle:], *frame]


@lru_cache(maxsize=16)
def _distinct_patterns(columns: int, rows: int) -> NDArray[np.int_]:
    """The patterns of an S-matrix (patterns, patches), ordered so that a face tells each from the next and the others.

    A face sees little more of a pattern than its middle. The best of many random orders of rows and columns has the
    middles of patterns far apart, above all those of successive ones.
    """
    matrix = s_matrix(columns * rows)
    places = np.stack(np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-0.6, 0.6, rows)), axis=-1).reshape(-1, 2)
    random = np.random.default_rng(0)
    best, best_score = matrix, -np.inf
    apart = ~np.eye(len(matrix), dtype=np.bool_)
    for _ in range(ORDERS_TRIED):
        shuffled = matrix[random.permutation(len(matrix))][:, random.permutation(matrix.shape[1])]
        middles = shuffled @ places
        distances = np.linalg.norm(middles[:, None] - middles[None], axis=2)
        successive = float(distances.diagonal(1).min())
        score = successive + float(distances[apart].min()) + 0.2 * float(distances.mean())
        if score > best_score:
            best, best_score = shuffled, score
    return best


def pattern_light(pattern: Pattern, patches: int, gamma: float = 2.2, black: float = 0.0) -> Float64Array:
    """Light (patches,) that each patch adds to that of a black screen, relative to white.

    A screen gives s · (p + black)^gamma for a pixel value p.
    """
    values = np.full(patches, float(pattern == "white")) if isinstance(pattern, str) else np.array(pattern, float)
    lit = (values + black) ** gamma - black**gamma
    return np.asarray(lit / ((1 + black) ** gamma - black**gamma))


def pattern_lights(sequence: Sequence[Pattern], patches: int, gamma: float = 2.2, black: float = 0.0) -> Float64Array:
    """`pattern_light` of each pattern: (patterns, patches)."""
    return np.stack([pattern_light(pattern, patches, gamma, black) for pattern in sequence])


def undetermined_patches(lights: Float64Array) -> list[int]:
    """Patches whose own picture does not follow from pictures under these lights (pictures, patches) and the room's."""
    design = np.concatenate([lights, np.ones((len(lights), 1))], axis=1)
    _, values, axes = np.linalg.svd(design, full_matrices=True)
    rank = int((values > 1e-6 * max(values.max(initial=0), 1e-12)).sum())
    hidden = np.abs(axes[rank:, :-1]).max(axis=0, initial=0)
    return [int(patch) for patch in np.flatnonzero(hidden > 1e-6)]


def demultiplex(pictures: Float32Array, lights: Float64Array) -> tuple[Float32Array, Float32Array]:
    """The pictures of single patches, by least squares: the room's light is one more unknown.

    Args:
        pictures: (count, ...) linear, each under its pattern and the room's light.
        lights: (count, patches) of `pattern_lights`, with no undetermined patch.

    Returns:
        (patches, ...) under each patch alone at white, and (...) under the room's light and the black screen.
    """
    design = np.concatenate([lights, np.ones((len(lights), 1))], axis=1)
    solved = np.tensordot(np.linalg.pinv(design).astype(np.float32), pictures, axes=1)
    return solved[:-1], solved[-1]
