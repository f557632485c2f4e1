"""The mannequin: all parts in one mesh that can be posed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import Angles, Rotation, rotation_from_angles
from relit_studio.mannequin.shape import features
from relit_studio.mannequin.shape.bust import base, neck, pullover
from relit_studio.mannequin.shape.expression import Expression, control_vertices, gaze_rotation, jaw_motion
from relit_studio.mannequin.shape.head import FACE_COUNT, SCHEME, control_head, eye_center
from relit_studio.mannequin.shape.mannequin_hair import hair
from relit_studio.mannequin.shape.mesh import Triangles, normal_operator, vertex_normals
from relit_studio.mannequin.shape.part import SKIN, Part
from relit_studio.mannequin.shape.texture_atlas import atlas, face_paint_position

PIVOT = np.array([0.0, -7.0, -4.0])
"""Center of the head's rotation in the neck, in head axes, centimeters."""
_NECK_TURNS = (-13.0, -5.5)
"""Heights between which the neck's fraction of the head's rotation grows from 0 to 1."""


@dataclass(frozen=True)
class Posture:
    """Head rotation relative to the room (degrees, see `base.rotations`), and facial expression."""

    angles: Angles = field(default_factory=lambda: Angles(0.0, 0.0, 0.0))
    expression: Expression = field(default_factory=Expression)

    @property
    def rotation(self) -> Rotation:
        """Room from head."""
        return rotation_from_angles(*self.angles)


@dataclass(frozen=True, eq=False)
class Figure:
    """The whole mannequin; arrays of its vertices are read-only.

    Room axes are the head's at rest: X right in the picture, Y up, Z toward the camera, centimeters, the origin where
    the canonical face has it when the head is upright.

    Attributes:
        parts: by name, in the order of their vertices.
        triangles, casters: of all parts; the casters are fewer and throw the shadows of moving pictures.
        part_of: (vertices,) index of each vertex's part.
        color: (vertices, 3) float32 linear albedo, multiplied by the paint.
        paint: (vertices, 2) float32 position in the paint atlas.
        shine, exponent: (vertices,) float32, the finish.
        summing: operator of `vertex_normals`.
    """

    parts: dict[str, Part]
    triangles: Triangles
    casters: Triangles
    part_of: NDArray[np.int64]
    color: NDArray[np.float32]
    paint: NDArray[np.float32]
    shine: NDArray[np.float32]
    exponent: NDArray[np.float32]
    summing: sparse.csr_array

    def vertices(self, posture: Posture) -> NDArray[np.float32]:
        """Vertices (count, 3) float32 in room axes."""
        expression, rotation = posture.expression, posture.rotation
        placed = []
        for name, part in self.parts.items():
            if name == "skin":
                points = control_head().skin @ control_vertices(expression)
            elif name in _EYES:
                points = part.vertices @ gaze_rotation(expression).T + eye_center(_EYES[name])
            elif name == "lower teeth":
                points = part.vertices + jaw_motion(part.vertices, expression.jaw)
            else:
                points = part.vertices
            if name == "neck":
                low, high = _NECK_TURNS
                fraction = smoothstep(points[:, 1:2], low, high)
                points = points + fraction * (_turned(points, rotation) - points)
            elif name != "pullover":
                points = _turned(points, rotation)
            placed.append(points)
        return np.concatenate(placed).astype(np.float32)

    def normals(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Unit normals (count, 3) of posed vertices."""
        normals: NDArray[np.float32] = vertex_normals(vertices, self.triangles, self.summing)
        return normals

    def landmarks(self, posture: Posture) -> Float64Array:
        """The points of scheme mesh478, (478, 3) float64 in room axes."""
        head = control_head()
        skin = head.skin[:FACE_COUNT] @ control_vertices(posture.expression)
        looking = features.iris_points() @ gaze_rotation(posture.expression).T
        irises = [looking + eye_center(eye) for eye in _EYES.values()]
        return _turned(np.concatenate([skin, *irises]), posture.rotation)

    def albedo(self, color: NDArray[np.float32], paint: NDArray[np.float32]) -> NDArray[np.float32]:
        """Linear albedo (count, 3) of points with this color (count, 3) and this place in the atlas (count, 2)."""
        # cv2.remap takes pictures of up to 32767 pixels a side.
        width = 1024
        rows = -(-len(paint) // width)
        position = np.zeros((rows * width, 2), np.float32)
        position[: len(paint)] = paint
        sampled = cv2.remap(atlas(), position.reshape(rows, width, 2), None, cv2.INTER_LINEAR)
        return np.asarray(color * sampled.reshape(-1, 3)[: len(paint)])


_EYES = {"right eye": SCHEME.right_eye, "left eye": SCHEME.left_eye}


@lru_cache(maxsize=1)
def mannequin() -> Figure:
    """The mannequin, built once and cached."""
    skin = _skin()
    listed = [
        skin,
        *(features.eyeball(eye, name) for name, eye in _EYES.items()),
        features.teeth("upper teeth", upper=True),
        features.teeth("lower teeth", upper=False),
        features.ear("right ear", -1),
        features.ear("left ear", 1),
        hair(skin.vertices),
        neck(),
        pullover(),
        base(),
    ]
    counts = [len(part.vertices) for part in listed]
    starts = np.cumsum([0, *counts])
    triangles = np.concatenate([part.triangles + start for part, start in zip(listed, starts, strict=False)])
    return Figure(
        parts={part.name: part for part in listed},
        triangles=triangles,
        casters=np.concatenate([part.casters + start for part, start in zip(listed, starts, strict=False)]),
        part_of=np.repeat(np.arange(len(listed)), counts),
        color=_frozen(np.concatenate([part.color for part in listed])),
        paint=_frozen(np.concatenate([part.paint for part in listed])),
        shine=_frozen(np.repeat([part.finish.shine for part in listed], counts)),
        exponent=_frozen(np.repeat([part.finish.exponent for part in listed], counts)),
        summing=normal_operator(triangles, int(starts[-1])),
    )


def _skin() -> Part:
    head = control_head()
    vertices = head.skin @ control_vertices(Expression())
    tint = np.ones((len(head.mesh.vertices), 3))
    around = len(SCHEME.upper_lip_inner) * 2 - 2
    # From the lips inwards: moist red, then dark.
    for ring, tone in enumerate(((0.55, 0.4, 0.4), (0.16, 0.07, 0.07), (0.06, 0.02, 0.02), (0.03, 0.01, 0.01))):
        tint[head.mouth.start + ring * around : min(head.mouth.start + (ring + 1) * around, head.mouth.stop)] = tone
    color = head.skin @ tint
    return Part(
        "skin", vertices, head.skin_triangles, head.caster_triangles, color, face_paint_position(vertices), SKIN
    )


def _turned(points: Float64Array, rotation: Rotation) -> Float64Array:
    return np.asarray((points - PIVOT) @ rotation.as_matrix().T + PIVOT)


def _frozen(values: NDArray) -> NDArray[np.float32]:
    result = np.ascontiguousarray(values, np.float32)
    result.setflags(write=False)
    return result
