"""Posture of a person: head rotation and facial expression."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import transform

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import Angles, Rotation, rotation_from_angles
from relit_studio.people.face.expressions import NEUTRAL, Expression

PIVOT = np.array([0.0, -4.0, -1.0])
"""Center of the head's rotation in the neck, in head axes, centimeters."""


@dataclass(frozen=True)
class Posture:
    """Head rotation relative to the room, and facial expression."""

    angles: Angles = field(default_factory=lambda: Angles(0.0, 0.0, 0.0))
    expression: Expression = field(default_factory=lambda: NEUTRAL)

    @property
    def rotation(self) -> Rotation:
        """Room from head."""
        return rotation_from_angles(*self.angles)


def follows_head(points: Float64Array) -> Float64Array:
    """Share (n,) of the head's rotation that points at rest (n, 3) follow: 1 on the head, 0 below the neck."""
    return smoothstep(points[:, 1] + 0.25 * points[:, 2], -12.5, -6.5)


def turned(points: Float64Array, rotation: Rotation, fraction: Float64Array | None = None) -> Float64Array:
    """Points (n, 3) rotated about the pivot in the neck, by the part `fraction` (n,) of the rotation where given."""
    offset = points - PIVOT
    if fraction is None:
        return np.asarray(rotation.apply(offset) + PIVOT)
    return np.asarray(transform.Rotation.from_rotvec(fraction[:, None] * rotation.as_rotvec()).apply(offset) + PIVOT)


def rigid_motion(rotation: Rotation) -> Float64Array:
    """The head's rotation about the pivot as a matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = PIVOT - rotation.apply(PIVOT)
    return matrix
