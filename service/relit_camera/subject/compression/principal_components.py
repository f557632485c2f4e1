"""Principal components of a cluster of pixels, quantized to 8 bits, and the basis over lights that all clusters share.

A cluster keeps as many components as its error threshold requires. The components of all clusters are then expressed
in one orthonormal basis over lights, in which each has few coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

Values = NDArray[np.float32]

MAX_CODE = 127
"""Values are kept as -127..127 times their scale."""


@dataclass(frozen=True)
class ClusterComponents:
    """A cluster's rows as Σ_j codes[j] · scales[j] · vectors[j].

    Attributes:
        codes: (count, rows) int8.
        scales: (count,) float32.
        vectors: (count, columns) float16 of unit length; one is repeated where 8 bits do not hold its amounts.
    """

    codes: NDArray[np.int8]
    scales: Values
    vectors: NDArray[np.float16]

    @property
    def energies(self) -> Values:
        """Energy (count,) of each component: the sum of squares of its part of the rows."""
        codes = self.codes.astype(np.float32)
        return np.asarray(np.einsum("jr,jr->j", codes, codes) * self.scales**2)

    def restored(self) -> Values:
        """The rows (rows, columns), decoded."""
        amounts = self.codes.astype(np.float32) * self.scales[:, None]
        return np.asarray(amounts.T @ self.vectors.astype(np.float32))


@dataclass(frozen=True)
class PixelCluster:
    """The rows (rows, columns) float32 of a cluster: its pixels' channels under columns scaled to equal importance."""

    rows: Values

    @cached_property
    def _principal(self) -> tuple[Values, Values]:
        """Principal directions over the rows, as columns, by falling energy; and the energies."""
        # From the smaller Gram matrix: a cluster has fewer rows than columns.
        energies, vectors = np.linalg.eigh((self.rows @ self.rows.T).astype(np.float64))
        return np.ascontiguousarray(vectors[:, ::-1], np.float32), energies[::-1].astype(np.float32)

    def components(self, threshold: float) -> ClusterComponents:
        """The principal components whose energy exceeds `threshold`, quantized to 8 bits.

        The quantization error of a component is kept as another component, by the same rule.
        """
        directions, energies = self._principal
        kept = directions[:, : max(1, int((energies > threshold).sum()))]
        vectors = kept.T @ self.rows
        lengths = np.linalg.norm(vectors, axis=1) + np.float32(1e-20)
        residual, vectors = (kept * lengths).T, vectors / lengths[:, None]
        codes, scales, used = [], [], []
        chosen = np.arange(len(residual))
        while len(chosen):
            scale = np.abs(residual).max(axis=1) / MAX_CODE + np.float32(1e-30)
            code = np.rint(residual / scale[:, None])
            codes.append(code.astype(np.int8))
            scales.append(scale)
            used.append(chosen)
            residual = residual - code * scale[:, None]
            again = np.einsum("jr,jr->j", residual, residual) > threshold
            residual, chosen = residual[again], chosen[again]
        order = np.concatenate(used)
        return ClusterComponents(np.concatenate(codes), np.concatenate(scales), vectors[order].astype(np.float16))


CLUSTERS_PER_BATCH = 64
"""Clusters whose Gram matrices are summed together; one at a time the addition would take longer than the product."""


@dataclass(frozen=True)
class SharedBasis:
    """Orthonormal vectors over columns (texels and lights), and the clusters' components in them.

    Attributes:
        vectors: (components, columns) float32.
        mixes: for each cluster (count, components) float16, the coefficients of its components.
        error: (columns,) sum of squared residuals over all clusters.
    """

    vectors: Values
    mixes: list[NDArray[np.float16]]
    error: NDArray[np.float64]


def fit_shared_basis(clusters: Sequence[ClusterComponents], allowed: float) -> SharedBasis:
    """The fewest principal directions of all clusters' components with an error of `allowed` at most in every column.

    Principal components of the clusters' principal components are those of the whole, up to what the clusters dropped.
    """
    energies, directions, totals = _principal_directions(clusters, allowed)
    left = totals[:, None] - np.cumsum(directions**2 * energies, axis=1)
    enough = np.flatnonzero(left.max(axis=0) <= allowed)
    count = int(enough[0]) + 1 if len(enough) else len(energies)
    vectors = np.ascontiguousarray(directions[:, :count].T, np.float32)
    mixes = [(cluster.vectors.astype(np.float32) @ vectors.T).astype(np.float16) for cluster in clusters]
    return SharedBasis(vectors, mixes, _squared_error(clusters, vectors, mixes))


def _principal_directions(
    clusters: Sequence[ClusterComponents], above: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Principal directions of all clusters' components together, and the energy of every column.

    Returns:
        Energies (count,), falling, and directions (columns, count): the first, and all others with an energy over
        `above`. The rest cannot leave an error over `above` in any column. Then the columns' energies (columns,).
    """
    columns = clusters[0].vectors.shape[1]
    weighted = (each.vectors.astype(np.float32) * np.sqrt(each.energies)[:, None] for each in clusters)
    if sum(len(each.scales) for each in clusters) < columns:
        rows = np.concatenate(list(weighted)).astype(np.float64)
        energies, mixed = _strongest(rows @ rows.T, above)
        directions = rows.T @ (mixed / np.sqrt(np.maximum(energies, 1e-20)))
        return energies, directions, np.einsum("rc,rc->c", rows, rows)
    gram = np.zeros((columns, columns))
    for batch in iter(lambda: list(islice(weighted, CLUSTERS_PER_BATCH)), []):
        rows = np.concatenate(batch)
        gram += rows.T @ rows
    return *_strongest(gram, above), np.diag(gram)


def _strongest(gram: NDArray[np.float64], above: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eigenvalues (count,) over `above`, falling, and their eigenvectors (size, count); the largest in any case."""
    values, vectors = eigh(gram, subset_by_value=(above, np.inf))
    if not len(values):
        values, vectors = eigh(gram, subset_by_index=(len(gram) - 1, len(gram) - 1))
    return np.maximum(values[::-1], 0), vectors[:, ::-1]


def _squared_error(
    clusters: Sequence[ClusterComponents], vectors: Values, mixes: list[NDArray[np.float16]]
) -> NDArray[np.float64]:
    error = np.zeros(vectors.shape[1])
    for cluster, mix in zip(clusters, mixes, strict=True):
        residual = cluster.vectors.astype(np.float32) - mix.astype(np.float32) @ vectors
        error += cluster.energies @ residual**2
    return error
