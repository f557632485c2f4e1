"""The canonical face: a mean head shape in head axes, on which landmark schemes are defined.

It is MediaPipe's `canonical_face_model.obj` (Apache-2.0, its licence lies beside it). Its axes are the project's:
centimetres, X right in the picture for a person who faces the camera, Y up, Z toward the camera. So the subject's right
eye, whose outer corner is vertex 33, has x < 0: it is at the left of an unmirrored picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class CanonicalFace:
    """A triangle mesh; its arrays are read-only.

    Attributes:
        vertices: (468, 3) float64 centimetres in head axes; vertex i is point i of the `mesh478` scheme.
        triangles: (898, 3) int32 vertex indices, counter-clockwise seen from outside.
        uvs: (468, 2) float32 texture position of each vertex in 0..1, v up.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uvs: NDArray[np.float32]


@lru_cache(maxsize=1)
def canonical_face() -> CanonicalFace:
    """Read the packaged canonical face; the same object every time."""
    text = files("relit_camera.face.landmarks").joinpath("canonical_face_model.obj").read_text(encoding="ascii")
    rows: dict[str, list[list[str]]] = {"v": [], "vt": [], "f": []}
    for line in text.splitlines():
        kind, *values = line.split() or [""]
        if kind in rows:
            rows[kind].append(values)
    vertices = np.array(rows["v"], dtype=np.float64)
    corners = np.array([[corner.split("/") for corner in face] for face in rows["f"]], dtype=np.int32) - 1
    triangles = np.ascontiguousarray(corners[..., 0])
    uvs = np.empty((len(vertices), 2), dtype=np.float32)
    uvs[triangles] = np.array(rows["vt"], dtype=np.float32)[corners[..., 1]]
    for array in (vertices, triangles, uvs):
        array.setflags(write=False)
    return CanonicalFace(vertices, triangles, uvs)
