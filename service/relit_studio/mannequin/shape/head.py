"""The head's control mesh: the canonical face with eye and mouth openings, closed into a skull.

Loop subdivision turns it into the smooth skin. Its first 468 vertices are the canonical face's, so landmark i is vertex
i of the skin in every expression.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import sparse

from relit_camera.base.array_types import Float64Array
from relit_camera.face.landmarks.canonical_face import canonical_face
from relit_camera.face.landmarks.landmark_schemes import EyeLandmarks, landmark_scheme
from relit_studio.mannequin.shape.mesh import Mesh, Triangles, extrude, loop_subdivision

SCHEME = landmark_scheme("mesh478")
FACE_COUNT = 468
LIP_RIM = (*SCHEME.upper_lip_inner, *SCHEME.lower_lip_inner[-2:0:-1])
"""The closed inner edge of the lips."""

EYE_RADIUS = 1.45
"""Centimeters. A little larger than life, which keeps the lids round."""
LID_THICKNESS = 0.1

SKULL_CENTER = np.array([0.0, 3.2, -2.2])
SKULL_RADII = np.array([7.7, 9.9, 9.4])
_SKULL_RINGS = (0.1, 0.22, 0.36, 0.52, 0.68, 0.84)


@dataclass(frozen=True, eq=False)
class ControlHead:
    """Control mesh of the head, which expressions deform.

    Attributes:
        mesh: the control mesh.
        skin: matrix (fine, coarse) of the subdivided skin's vertices.
        skin_triangles: of the subdivided skin.
        caster_triangles: of the skin subdivided once less, over the same vertices: enough to cast shadows.
        mouth: control vertices of the mouth's inside.
        skull: control vertices behind the face, the rings from front to back.
    """

    mesh: Mesh
    skin: sparse.csr_array
    skin_triangles: Triangles
    caster_triangles: Triangles
    mouth: range
    skull: range


@lru_cache(maxsize=1)
def control_head() -> ControlHead:
    """The head at rest, as the canonical face stands: lips a little apart, eyes half open."""
    face = canonical_face()
    mesh = Mesh(face.vertices, _opened(face.triangles.astype(np.int64)))
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        mesh = extrude(mesh, eye.lids, _eye_pocket(mesh.vertices[list(eye.lids)]))
    mouth_start = len(mesh.vertices)
    mesh = _mouth(mesh)
    skull_start = len(mesh.vertices)
    mesh = _skull(mesh)
    loops = (SCHEME.right_eye.lids, SCHEME.left_eye.lids, LIP_RIM)
    sharp = [(loop[i - 1], loop[i]) for loop in loops for i in range(len(loop))]
    count = len(mesh.vertices)
    once, caster, sharp = loop_subdivision(mesh.triangles, count, sharp)
    twice, triangles, _ = loop_subdivision(caster, once.shape[0], sharp)
    return ControlHead(
        mesh=mesh,
        skin=sparse.csr_array(twice @ once),
        skin_triangles=triangles,
        caster_triangles=caster,
        mouth=range(mouth_start, skull_start),
        skull=range(skull_start, count),
    )


def eye_center(eye: EyeLandmarks) -> Float64Array:
    """Center (3,) of the eyeball, so that its front touches the lids from behind."""
    lids = canonical_face().vertices[list(eye.lids)]
    middle = lids.mean(axis=0)
    upper, lower = (canonical_face().vertices[list(points)].mean(axis=0) for points in eye.gap)
    depth = np.sqrt(EYE_RADIUS**2 - ((upper - lower)[1] / 2) ** 2)
    return np.array([middle[0], middle[1], (upper + lower)[2] / 2 - LID_THICKNESS - depth])


def _opened(triangles: Triangles) -> Triangles:
    """The face without the triangles that close its eyes and mouth."""
    kept = np.ones(len(triangles), bool)
    for loop in (SCHEME.right_eye.lids, SCHEME.left_eye.lids, LIP_RIM):
        kept &= ~np.isin(triangles, loop).all(axis=1)
    return triangles[kept]


def _eye_pocket(lids: Float64Array) -> list[Float64Array]:
    middle = lids.mean(axis=0)
    return [lids - [0, 0, 0.3], middle + (lids - middle) * [1.08, 1.5, 1] - [0, 0, 0.9]]


def _mouth(mesh: Mesh) -> Mesh:
    lips = mesh.vertices[list(LIP_RIM)]
    middle = lips.mean(axis=0)
    inner = middle + (lips - middle) * [0.98, 1.5, 1] - [0, 0, 0.5]
    wide = middle + (lips - middle) * [1.05, 4.0, 0.9] - [0, 0, 1.3]
    deep = middle + (lips - middle) * [0.9, 3.6, 0.6] - [0, 0, 2.9]
    return extrude(mesh, LIP_RIM, [inner, wide, deep], cap=middle - [0, 0, 3.2])


def _skull(mesh: Mesh) -> Mesh:
    """Rings from the face's outline over an ellipsoid to the back of the head."""
    offset = mesh.vertices[list(SCHEME.oval)] - SKULL_CENTER
    radius = np.linalg.norm(offset, axis=1, keepdims=True)
    start, end = offset / radius, np.array([0.0, -0.05, -1.0]) / np.hypot(0.05, 1.0)
    angle = np.arccos(start @ end)[:, None]
    rings = []
    for t in _SKULL_RINGS:
        direction = (np.sin((1 - t) * angle) * start + np.sin(t * angle) * end) / np.sin(angle)
        ellipsoid = 1 / np.linalg.norm(direction / SKULL_RADII, axis=1, keepdims=True)
        fraction = np.clip(t / 0.4, 0, 1) ** 1.5
        rings.append(SKULL_CENTER + direction * (radius + (ellipsoid - radius) * fraction))
    return extrude(mesh, SCHEME.oval, rings, cap=SKULL_CENTER + end * SKULL_RADII[2])
