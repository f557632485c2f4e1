"""Facial expressions of the mannequin, as displacements of the head's control mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from relit_camera.base.array_types import Float64Array
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.landmarks.landmark_schemes import EyeLandmarks
from relit_studio.mannequin.shape.head import (
    EYE_RADIUS,
    FACE_COUNT,
    LID_THICKNESS,
    SCHEME,
    control_head,
    eye_center,
)
from relit_studio.mannequin.shape.mesh import spread

JAW_HINGE = np.array([0.0, 0.0, -3.0])
JAW_RANGE_DEG = 23.0
_EYES_WIDENED = 0.3
"""Extra opening of the mannequin's eyes over the canonical face, as a fraction of the lid gap."""

_FRIENDLY = 0.2
"""Smile of the neutral face."""
_UPPER_LIP = (0.45, 0.22, 0.08, 0.0, 0.0, 0.0)
_LOWER_LIP = (0.45, 0.68, 0.88, 1.0, 1.0, 1.0)
"""Fraction of the jaw's motion that the lips follow, from the corner to the middle."""


@dataclass(frozen=True)
class Expression:
    """Facial expression. All zero is neutral: lips closed, eyes open and looking ahead. Right is the subject's.

    Attributes:
        jaw: 0 closed to 1 wide open.
        blink_right, blink_left: 0 open to 1 shut.
        smile: 0 to 1, lips closed.
        brows: -0.5 lowered to 1 raised.
        gaze_yaw_deg, gaze_pitch_deg: of the eyes in the head, signs as a head's: yaw > 0 to the picture's right, pitch
            > 0 down.
    """

    jaw: float = 0.0
    blink_right: float = 0.0
    blink_left: float = 0.0
    smile: float = 0.0
    brows: float = 0.0
    gaze_yaw_deg: float = 0.0
    gaze_pitch_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class _Fields:
    """Displacements (control vertices, 3) in centimeters of each movement at 1, and the jaw's weights (vertices, 1)."""

    rest: Float64Array
    blink_right: Float64Array
    blink_left: Float64Array
    smile: Float64Array
    brows: Float64Array
    jaw: Float64Array


def control_vertices(expression: Expression) -> Float64Array:
    """The control mesh's vertices (count, 3) in head axes, in this expression."""
    fields = _fields()
    vertices = (
        fields.rest
        + expression.blink_right * fields.blink_right
        + expression.blink_left * fields.blink_left
        + expression.smile * fields.smile
        + expression.brows * fields.brows
    )
    vertices += jaw_motion(vertices, expression.jaw * fields.jaw)
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        _keep_outside_eyeball(vertices, eye)
    return vertices


def jaw_motion(points: Float64Array, opening: ArrayLike) -> Float64Array:
    """Displacements (count, 3) of points (count, 3) that follow a jaw opened by fractions (count, 1) or one number."""
    angle = np.radians(JAW_RANGE_DEG) * np.asarray(opening, np.float64)
    y, z = points[:, 1:2] - JAW_HINGE[1], points[:, 2:] - JAW_HINGE[2]
    # A turn about X takes Z down, as a jaw opens.
    down = np.cos(angle) * y - np.sin(angle) * z - y
    back = np.sin(angle) * y + np.cos(angle) * z - z
    return np.concatenate([np.zeros_like(down), down, back], axis=1)


def gaze_rotation(expression: Expression) -> Float64Array:
    """Rotation matrix (3, 3) of both eyeballs in the head."""
    return rotation_from_angles(expression.gaze_yaw_deg, expression.gaze_pitch_deg).as_matrix()


@lru_cache(maxsize=1)
def _fields() -> _Fields:
    head = control_head()
    canonical = head.mesh.vertices
    rest = canonical + _close_lips(canonical)
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        rest += -_EYES_WIDENED * _blink(canonical, eye, upper_fraction=0.7)
    rest += _FRIENDLY * _smile(rest)
    # One step towards a skin that passes through the control points: subdivision alone rounds nose and lips off.
    correction = rest - (head.skin @ rest)[: len(rest)]
    correction[FACE_COUNT:] = 0
    return _Fields(
        rest=rest + 0.8 * correction,
        blink_right=_blink(rest, SCHEME.right_eye, upper_fraction=0.86),
        blink_left=_blink(rest, SCHEME.left_eye, upper_fraction=0.86),
        smile=_smile(rest),
        brows=_raise_brows(rest),
        jaw=_jaw_weights(rest),
    )


def _spread(fixed: dict[int, ArrayLike], order: int = 2) -> Float64Array:
    mesh = control_head().mesh
    return spread(mesh.triangles, len(mesh.vertices), fixed, order)


def _still(points: Float64Array, middle: Float64Array, radius: float, *but: int) -> dict[int, ArrayLike]:
    """Zero displacements that fix all vertices farther than `radius` from `middle`, except vertices `but`."""
    far = np.flatnonzero(np.linalg.norm(points - middle, axis=1) > radius)
    return {int(index): np.zeros(3) for index in far if index not in but}


def _lid_pairs(eye: EyeLandmarks) -> list[tuple[int, int]]:
    """(upper, lower) lid points, from the outer to the inner corner, corners left out."""
    upper, lower = eye.lids[1:8], eye.lids[:8:-1]
    return list(zip(upper, lower, strict=True))


def _blink(points: Float64Array, eye: EyeLandmarks, upper_fraction: float) -> Float64Array:
    middle = points[list(eye.lids)].mean(axis=0)
    fixed = _still(points, middle, 2.3, *eye.lids)
    fixed |= {eye.outer: np.zeros(3), eye.inner: np.zeros(3)}
    for upper, lower in _lid_pairs(eye):
        gap = points[lower] - points[upper]
        fixed[upper], fixed[lower] = upper_fraction * gap, (upper_fraction - 1) * gap
    return _spread(fixed)


def _keep_outside_eyeball(vertices: Float64Array, eye: EyeLandmarks) -> None:
    center = eye_center(eye)
    near = np.linalg.norm(vertices[:FACE_COUNT] - center, axis=1) < EYE_RADIUS + 0.6
    indices = np.flatnonzero(near)
    offset = vertices[indices] - center
    distance = np.linalg.norm(offset, axis=1, keepdims=True)
    vertices[indices] = center + offset * np.maximum(1, (EYE_RADIUS + LID_THICKNESS) / distance)


def _close_lips(points: Float64Array) -> Float64Array:
    middle = points[[13, 14]].mean(axis=0)
    mouth = control_head().mouth
    fixed = _still(points, middle, 3.4, *mouth)
    fixed |= {index: np.zeros(3) for index in (61, 291, 78, 308, 2, 164)}
    for upper, lower in zip(SCHEME.upper_lip_inner[1:-1], SCHEME.lower_lip_inner[1:-1], strict=True):
        meeting = points[[upper, lower]].mean(axis=0)
        # Lips that meet press against each other and swell a little.
        meeting[2] = points[[upper, lower], 2].mean() + 0.06
        fixed[upper], fixed[lower] = (
            meeting - points[upper] + [0, -0.01, 0.03],
            meeting - points[lower] + [0, 0.01, -0.03],
        )
    return _spread(fixed)


def _smile(points: Float64Array) -> Float64Array:
    fixed = _still(points, np.array([0, -3.2, 3.5]), 6.3, *control_head().mouth)
    fixed |= {index: np.zeros(3) for index in (1, 2, 4, 5, 195, 152, 175, 199, 98, 327, 33, 263, 133, 362)}
    # Handles of the picture's left half; the other half mirrors them.
    handles = {
        61: (-0.7, 0.46, -0.45),
        78: (-0.64, 0.45, -0.45),
        0: (0, 0.1, -0.14),
        13: (0, 0.1, -0.14),
        14: (0, 0.1, -0.14),
        17: (0, 0.08, -0.15),
        50: (-0.14, 0.32, 0.16),
        205: (-0.22, 0.36, 0.2),
        145: (0, 0.1, 0.02),
    }
    mirror = {61: 291, 78: 308, 50: 280, 205: 425, 145: 374}
    for index, displacement in handles.items():
        fixed[index] = np.array(displacement)
        if index in mirror:
            fixed[mirror[index]] = np.array(displacement) * [-1, 1, 1]
    return _spread(fixed)


def _raise_brows(points: Float64Array) -> Float64Array:
    brows = [*SCHEME.right_brow, *SCHEME.left_brow]
    middle = points[brows].mean(axis=0)
    fixed = _still(points, middle, 6.2, *brows)
    fixed |= {index: np.zeros(3) for index in (6, *SCHEME.right_eye.lids, *SCHEME.left_eye.lids, *SCHEME.oval)}
    fixed |= {index: np.array([0, 0.62, 0.02]) for index in brows}
    return _spread(fixed)


def _jaw_weights(points: Float64Array) -> Float64Array:
    """1 where skin follows the jaw, 0 where it stays with the skull, (count, 1)."""
    head = control_head()
    face = points[:FACE_COUNT]
    oval = list(SCHEME.oval)
    jaw_line = dict(
        zip((152, 148, 176, 149, 150, 136, 172, 58, 132), (1, 1, 1, 0.98, 0.9, 0.7, 0.4, 0.15, 0.03), strict=True)
    )
    mirrored = {oval[-oval.index(index)]: weight for index, weight in jaw_line.items()}
    above = np.flatnonzero(face[:, 1] > np.maximum(-2.6, 0.8 * np.abs(face[:, 0]) - 5.2))
    chin = np.flatnonzero((face[:, 1] < -5.6) & (np.abs(face[:, 0]) < 2.2))
    fixed: dict[int, ArrayLike] = {index: np.zeros(1) for index in oval}
    fixed |= {index: np.zeros(1) for index in head.skull[len(oval) :]}
    fixed |= {int(index): np.zeros(1) for index in above}
    fixed |= {int(index): np.ones(1) for index in chin}
    fixed |= {index: np.array([weight]) for index, weight in (jaw_line | mirrored).items()}
    for edge, weights in (
        (SCHEME.upper_lip_outer, _UPPER_LIP),
        (SCHEME.upper_lip_inner, _UPPER_LIP),
        (SCHEME.lower_lip_outer, _LOWER_LIP),
        (SCHEME.lower_lip_inner, _LOWER_LIP),
    ):
        fixed |= {index: np.array([weight]) for index, weight in zip(edge, (*weights, *weights[-2::-1]), strict=True)}
    return np.clip(_spread(fixed, order=1), 0, 1)
