"""Face model ICT-FaceKit: a head mesh with 100 identity and 57 expression blend shapes (Li et al. 2020)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import InputError
from relit_studio.people.geometry import triangles_of

IDENTITIES = 100


class Part(IntEnum):
    """Parts of the mesh, as `face_part` has them. Left is the subject's, at +X."""

    FACE = 0
    HEAD = 1
    MOUTH = 2
    SOCKET_LEFT = 3
    SOCKET_RIGHT = 4
    GUMS = 5
    TEETH = 6
    EYE_LEFT = 7
    EYE_RIGHT = 8
    TEAR_LEFT = 9
    TEAR_RIGHT = 10
    OCCLUSION_LEFT = 13
    OCCLUSION_RIGHT = 14
    LASHES_LEFT = 15
    LASHES_RIGHT = 16


CORNEA_MATERIALS = (4, 6)
"""Values of `face_material` of the eyeballs' outer shells, left and right; their inner shells are 5 and 7."""


@dataclass(frozen=True, eq=False)
class FaceModel:
    """Mean head and its blend shapes, in room axes and centimeters; the origin lies between the ears.

    Attributes:
        vertices: (26719, 3) float64.
        faces: (26384, 4) int; -1 in the last column of a triangle.
        face_uv, uv: the model's own texture corners (faces, 4) and coordinates, v up.
        face_part, face_material, vertex_part: see `Part`.
        identities: (100, 26719, 3) float16 offsets per unit weight.
        expressions: (57, 26719, 3) float16 offsets at weight 1, called `names`.
        landmarks68: (68,) vertices of the iBUG 300-W points.
    """

    vertices: Float64Array
    faces: NDArray[np.int32]
    face_uv: NDArray[np.int32]
    uv: NDArray[np.float32]
    face_part: NDArray[np.int8]
    face_material: NDArray[np.int8]
    vertex_part: NDArray[np.int8]
    identities: NDArray[np.float16]
    expressions: NDArray[np.float16]
    names: tuple[str, ...]
    landmarks68: NDArray[np.int32]

    def neutral(self, weights: NDArray) -> Float64Array:
        """Vertices of the identity with these weights (100,)."""
        return np.asarray(self.vertices + np.tensordot(weights, self.identities.astype(np.float32), 1))

    def displacement(self, expression: Mapping[str, float]) -> Float64Array:
        """Offsets (vertices, 3) of an expression, weights by name.

        Raises:
            InputError: no shape of that name.
        """
        total = np.zeros_like(self.vertices)
        for name, weight in expression.items():
            if name not in self.names:
                raise InputError(f"no expression '{name}'", f"use some of {', '.join(self.names)}")
            if weight:
                total += weight * self.expressions[self.names.index(name)].astype(np.float32)
        return total

    def triangles(self, *parts: Part) -> Indices:
        """Triangles of these parts."""
        return triangles_of(self.faces[np.isin(self.face_part, parts)])


def read_face_model(path: Path) -> FaceModel:
    """Read the packed model.

    Raises:
        InputError: the file is missing or holds no face model.
    """
    try:
        with path.open("rb") as file, np.load(file) as data:
            return FaceModel(
                vertices=data["vertices"].astype(np.float64),
                faces=data["faces"],
                face_uv=data["face_uv"],
                uv=data["uv"],
                face_part=data["face_part"],
                face_material=data["face_material"],
                vertex_part=data["vertex_part"],
                identities=data["identity_deltas"],
                expressions=data["expression_deltas"],
                names=tuple(str(name) for name in data["expression_names"]),
                landmarks68=data["landmarks68"],
            )
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(f"{path} is no packed face model: {error}", "fetch it again") from error
