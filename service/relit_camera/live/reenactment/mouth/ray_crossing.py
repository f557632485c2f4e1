"""Where parallel rays first meet a round body, and how much of a pixel it fills at its outline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

EDGE_ON = np.float32(0.25)
"""Cosine between a body's normal and the line of sight below which it fades out: else its outline is a staircase."""


def first_crossing(
    start: NDArray[np.float32], along: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Steps (count,) along each ray to the unit circle or sphere about the origin, and which rays meet it.

    Args:
        start: (axes, count) a point of each ray.
        along: (axes,) a step.
    """
    # a · s² + 2 b · s + c = 0.
    a = np.float32(max(float(along @ along), 1e-6))
    b, c = along @ start, np.einsum("ij,ij->j", start, start) - np.float32(1)
    inside = b * b - a * c
    return (-b - np.sqrt(np.maximum(inside, 0))) / a, inside > 0


def share_at_outline(normals: NDArray[np.float32], direction: NDArray[np.float32]) -> NDArray[np.float32]:
    """Share (count,) of a pixel that a body fills where it has `normals` (axes, count), of any length.

    Args:
        normals: outward.
        direction: (axes,) unit vector away from the camera, or its part along these axes.
    """
    lengths = np.sqrt(np.einsum("ij,ij->j", normals, normals) + np.float32(1e-9))
    return np.asarray(np.clip(-(direction @ normals) / (lengths * EDGE_ON), 0, 1), np.float32)
