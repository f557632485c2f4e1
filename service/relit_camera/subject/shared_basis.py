"""What the components of all clusters have in common: one basis over lights, in which each is short to tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from relit_camera.subject.cluster import Components

Values = NDArray[np.float32]

BATCH = 64
"""Clusters whose products are added up at once: one at a time, adding takes longer than multiplying."""


@dataclass(frozen=True)
class SharedBasis:
    """Orthonormal vectors over lights.

    Attributes:
        vectors: (components, columns) float32.
        mixes: for each cluster (count, components) float16, its components in them.
        error: (columns,) sum of squares, over all clusters, that is lost.
    """

    vectors: Values
    mixes: list[NDArray[np.float16]]
    error: NDArray[np.float64]


def share(clusters: Sequence[Components], allowed: float) -> SharedBasis:
    """The fewest principal directions of all clusters' components with an error of `allowed` at most in every column.

    Principal components of the parts' principal components are those of the whole, but for what the parts left out.
    """
    energies, directions = _principal(clusters)
    lost = np.cumsum((directions**2 * energies)[:, ::-1], axis=1)[:, ::-1].max(axis=0)
    enough = np.flatnonzero(lost <= allowed)
    count = int(enough[0]) if len(enough) else len(energies)
    vectors = np.ascontiguousarray(directions[:, : max(count, 1)].T, np.float32)
    mixes = [(cluster.vectors.astype(np.float32) @ vectors.T).astype(np.float16) for cluster in clusters]
    return SharedBasis(vectors, mixes, _error(clusters, vectors, mixes))


def _principal(clusters: Sequence[Components]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Energies (count,), falling, and unit vectors (columns, count) of all clusters' components together."""
    columns = clusters[0].vectors.shape[1]
    weighted = (each.vectors.astype(np.float32) * np.sqrt(each.energies)[:, None] for each in clusters)
    if sum(len(each.scales) for each in clusters) < columns:
        _, amounts, directions = np.linalg.svd(np.concatenate(list(weighted)).astype(np.float64), full_matrices=False)
        return amounts**2, directions.T
    gram = np.zeros((columns, columns))
    for batch in iter(lambda: list(islice(weighted, BATCH)), []):
        rows = np.concatenate(batch)
        gram += rows.T @ rows
    energies, directions = np.linalg.eigh(gram)
    return np.maximum(energies[::-1], 0), directions[:, ::-1]


def _error(clusters: Sequence[Components], vectors: Values, mixes: list[NDArray[np.float16]]) -> NDArray[np.float64]:
    error = np.zeros(vectors.shape[1])
    for cluster, mix in zip(clusters, mixes, strict=True):
        left = cluster.vectors.astype(np.float32) - mix.astype(np.float32) @ vectors
        error += cluster.energies @ left**2
    return error
