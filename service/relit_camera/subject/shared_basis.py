"""What the components of all clusters have in common: one basis over lights, in which each is short to tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.subject.cluster import Components

Values = NDArray[np.float32]


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
    columns = clusters[0].vectors.shape[1]
    gram = np.zeros((columns, columns))
    for cluster in clusters:
        weighted = cluster.vectors.astype(np.float32) * np.sqrt(cluster.energies)[:, None]
        gram += weighted.T @ weighted
    energies, directions = np.linalg.eigh(gram)
    energies, directions = np.maximum(energies[::-1], 0), directions[:, ::-1]
    lost = np.cumsum((directions**2 * energies)[:, ::-1], axis=1)[:, ::-1].max(axis=0)
    enough = np.flatnonzero(lost <= allowed)
    count = int(enough[0]) if len(enough) else columns
    vectors = np.ascontiguousarray(directions[:, : max(count, 1)].T, np.float32)
    mixes = [(cluster.vectors.astype(np.float32) @ vectors.T).astype(np.float16) for cluster in clusters]
    return SharedBasis(vectors, mixes, _error(clusters, vectors, mixes))


def _error(clusters: Sequence[Components], vectors: Values, mixes: list[NDArray[np.float16]]) -> NDArray[np.float64]:
    error = np.zeros(vectors.shape[1])
    for cluster, mix in zip(clusters, mixes, strict=True):
        left = cluster.vectors.astype(np.float32) - mix.astype(np.float32) @ vectors
        error += cluster.energies @ left**2
    return error
