"""One cluster of pixels as principal components in 8 bits, as many as the error asks for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float32]

CODES = 127
"""Values are kept as -127..127 times their scale."""


@dataclass(frozen=True)
class Components:
    """A cluster's rows as Σ_j codes[j] · scales[j] · vectors[j].

    Attributes:
        codes: (count, rows) int8.
        scales: (count,) float32.
        vectors: (count, columns) float16 of unit length; one occurs again where 8 bits do not tell its amounts.
    """

    codes: NDArray[np.int8]
    scales: Values
    vectors: NDArray[np.float16]

    @property
    def energies(self) -> Values:
        """Sum (count,) of the squares that each component stands for."""
        codes = self.codes.astype(np.float32)
        return np.asarray(np.einsum("jr,jr->j", codes, codes) * self.scales**2)

    def restored(self) -> Values:
        """The rows (rows, columns)."""
        amounts = self.codes.astype(np.float32) * self.scales[:, None]
        return np.asarray(amounts.T @ self.vectors.astype(np.float32))


@dataclass(frozen=True)
class Cluster:
    """Rows (rows, columns) float32 of a cluster: its pixels' channels, under lights that all count alike."""

    rows: Values

    @cached_property
    def _principal(self) -> tuple[Values, Values]:
        """Unit vectors over rows, as columns, by falling energy, and that energy."""
        # By the smaller side: a cluster has fewer rows than there are lights.
        energies, vectors = np.linalg.eigh((self.rows @ self.rows.T).astype(np.float64))
        return np.ascontiguousarray(vectors[:, ::-1], np.float32), energies[::-1].astype(np.float32)

    def components(self, threshold: float) -> Components:
        """The principal components that explain more than `threshold`, in 8 bits.

        What 8 bits leave of a component is kept as another one, by the same rule.
        """
        directions, energies = self._principal
        kept = directions[:, : max(1, int((energies > threshold).sum()))]
        vectors = kept.T @ self.rows
        lengths = np.linalg.norm(vectors, axis=1) + np.float32(1e-20)
        left, vectors = (kept * lengths).T, vectors / lengths[:, None]
        codes, scales, used = [], [], []
        chosen = np.arange(len(left))
        while len(chosen):
            scale = np.abs(left).max(axis=1) / CODES + np.float32(1e-30)
            code = np.rint(left / scale[:, None])
            codes.append(code.astype(np.int8))
            scales.append(scale)
            used.append(chosen)
            left = left - code * scale[:, None]
            again = np.einsum("jr,jr->j", left, left) > threshold
            left, chosen = left[again], chosen[again]
        order = np.concatenate(used)
        return Components(np.concatenate(codes), np.concatenate(scales), vectors[order].astype(np.float16))
