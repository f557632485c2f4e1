"""Whether a face is the subject's, by its shape and by how well any light on the subject explains it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.live.reenactment.source_image import SourceFace


@dataclass(frozen=True)
class IdentityTunables:
    """Thresholds of the check, measured on recorded and rendered faces.

    A person differs from their own subject by 0.03 to 0.17 cm of shape and a residual of 0.08 to 0.34, the most in
    coloured light, other people by 0.10 to 0.40 cm and 0.13 to 1.1. Either alone can mislead (a beard, a cap, a grimace
    of up to 0.5 cm), so the product of both, each divided by its threshold, decides.

    Attributes:
        shape_cm: RMS distance of the landmarks from the subject's, seen from the front.
        residual: deviation of the live face from the relit one under the best light, relative to its contrast.
    """

    shape_cm: float = 0.14
    residual: float = 0.23


def what_differs(shape_cm: float, residual: float, limits: IdentityTunables) -> str | None:
    """What tells a face from the subject's, in words; None where it passes for it.

    Args:
        shape_cm: its distance from the subject's, see `shape_distance_cm`.
        residual: how badly any light explains it, relative to its contrast, see `RoomLightEstimate`.
        limits: the thresholds.
    """
    if (shape_cm / limits.shape_cm) * (residual / limits.residual) <= 1:
        return None
    return f"it has another shape ({10 * shape_cm:.1f} mm) and looks so under no light (deviation {residual:.2f})"


def shape_distance_cm(points: NDArray[np.float64], face: SourceFace) -> float:
    """RMS distance in cm, seen from the front, of head-space points (count, 3) from those of the source image's face.

    Size, position and what a wrong focal length does (near parts too large) do not count. Eyes and lips are left out:
    they move.
    """
    moving = {*face.scheme.eyes, *face.scheme.lips}
    firm = [index for index in range(face.scheme.count) if index not in moving]
    live, source = (p[firm] - p[firm].mean(axis=0) for p in (points, face.head_points))
    front = live[:, :2]
    scalings = np.stack([front.ravel(), (front * live[:, 2:]).ravel()], axis=1)
    goal = source[:, :2].ravel()
    factors = np.linalg.lstsq(scalings, goal)[0]
    return float(np.sqrt(((scalings @ factors - goal) ** 2).sum() / len(firm)))
