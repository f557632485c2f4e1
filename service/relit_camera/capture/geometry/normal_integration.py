"""Normal integration: the depth map whose slopes are those of given normals, with steps where the surface has steps.

Bilateral normal integration (Cao, Santo, Shi, Okura and Matsushita, ECCV 2022). Along each axis a pixel's normal
predicts how far its two neighbours lie before or behind it. On a continuous surface both predictions hold; at a step
one fails, so each is weighted by a sigmoid of how much worse the other fits. Weights and depth are found in turn; every
round is a weighted Poisson equation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, cg, splu
from scipy.special import expit

from relit_camera.base.array_types import Float32Array

Values = NDArray[np.float64]


@dataclass(frozen=True)
class IntegrationTunables:
    """Constants of the integration, chosen by `relit evaluate field` on rendered heads unless the paper gives them.

    Attributes:
        sharpness: k of the sigmoid: how sharply one side is preferred over the other (the paper's value).
        rounds: largest number of rounds of reweighting.
        min_energy_change: relative change of the energy below which the rounds end.
        solver_tolerance: relative residual to which each round's equations are solved.
        min_facing: least z of a normal: a slope of 6.6. Steeper surfaces are seen too narrowly to be measured.
        anchor: weight that pulls all depths toward 0, because pieces that do not touch have no common depth.
    """

    sharpness: float = 2.0
    rounds: int = 6
    min_energy_change: float = 1e-3
    solver_tolerance: float = 1e-3
    min_facing: float = 0.15
    anchor: float = 1e-6


TUNABLES = IntegrationTunables()


@dataclass(frozen=True)
class _Side:
    """Equations for the depth step from each pixel to its neighbour on one side: matrix @ depth = steps."""

    matrix: csr_array
    steps: Values


def integrate_normals(
    normals: Float32Array,
    inside: NDArray[np.bool_],
    confidence: Float32Array | None = None,
    focal_px: float | None = None,
) -> Float32Array:
    """Depth (height, width) float32 in pixels, toward the camera, mean 0; NaN outside.

    Args:
        normals: (height, width, 3) unit vectors.
        inside: (height, width) pixels that have depth.
        confidence: (height, width) weight of each pixel's normal; equal weights where None.
        focal_px: the camera's focal length, its axis through the picture's middle; parallel projection where None. With
            it the unit of depth is a pixel's width at the person's mean distance.
    """
    facing, right, up = _slopes(normals, inside, focal_px)
    count = len(facing)
    sides = [
        _side(inside, facing, 0, 1, right),
        _side(inside, -facing, 0, -1, right),
        _side(inside, facing, -1, 0, up),
        _side(inside, -facing, 1, 0, up),
    ]
    reliability = np.ones(count) if confidence is None else confidence[inside].astype(np.float64)
    weights = [0.5 * reliability] * 4
    depth, energy, precondition = np.zeros(count), np.inf, None
    for _ in range(TUNABLES.rounds):
        matrix, target = _normal_equations(sides, weights)
        if precondition is None:
            # Weights change little after the first round: its factorization preconditions all.
            factors = splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
            precondition = LinearOperator(matrix.shape, factors.solve, dtype=np.float64)
        depth, _ = cg(matrix, target, x0=depth, M=precondition, rtol=TUNABLES.solver_tolerance, maxiter=200)
        misfits = [(side.matrix @ depth - side.steps) ** 2 for side in sides]
        before, energy = energy, sum(float(w @ m) for w, m in zip(weights, misfits, strict=True))
        if abs(before - energy) < TUNABLES.min_energy_change * energy:
            break
        first, third = (expit(TUNABLES.sharpness * (misfits[i + 1] - misfits[i])) for i in (0, 2))
        weights = [reliability * w for w in (first, 1 - first, third, 1 - third)]
    if focal_px is not None:
        depth = focal_px * -np.expm1(-(depth - depth.mean()) / focal_px)
    result = np.full(inside.shape, np.nan, np.float32)
    result[inside] = depth - depth.mean()
    return result


def _slopes(normals: Float32Array, inside: NDArray[np.bool_], focal_px: float | None) -> tuple[Values, Values, Values]:
    """For each pixel inside: z of its normal along the pixel's ray, and that times its slope to the right and up.

    In perspective the unknown is −f·log of the distance, whose slopes are -n_x and -n_y over n_z − (n_x·x + n_y·y) / f
    for a pixel at (x, y) from the axis.
    """
    x, y, z = normals[inside].astype(np.float64).T
    if focal_px is not None:
        height, width = inside.shape
        row, column = np.nonzero(inside)
        z = z - (x * (column + 0.5 - width / 2) + y * (height / 2 - row - 0.5)) / focal_px
    return np.maximum(z, TUNABLES.min_facing), -x, -y


def _side(inside: NDArray[np.bool_], facing: Values, down: int, right: int, steps: Values) -> _Side:
    """Equations facing · (neighbour − pixel) = steps for the neighbour `down` rows and `right` columns away.

    For neighbours on the left and below, `facing` and so the step have the opposite sign. Pixels without that
    neighbour have no equation.
    """
    height, width = inside.shape
    number = np.full((height + 2, width + 2), -1)
    number[1:-1, 1:-1][inside] = np.arange(len(facing))
    neighbour = number[1 + down : 1 + down + height, 1 + right : 1 + right + width][inside]
    own = np.flatnonzero(neighbour >= 0)
    values = np.concatenate([facing[own], -facing[own]])
    places = np.concatenate([own, own]), np.concatenate([neighbour[own], own])
    matrix = csr_array((values, places), shape=(len(facing), len(facing)))
    return _Side(matrix, np.where(neighbour >= 0, steps, 0))


def _normal_equations(sides: list[_Side], weights: list[Values]) -> tuple[csr_array, Values]:
    """The matrix and right-hand side of the weighted least-squares problem."""
    matrix = csr_array(diags_array(np.full(len(weights[0]), TUNABLES.anchor)))
    target = np.zeros(len(weights[0]))
    for side, weight in zip(sides, weights, strict=True):
        weighted = side.matrix.T @ diags_array(weight)
        matrix = matrix + weighted @ side.matrix
        target += weighted @ side.steps
    return csr_array(matrix), target
