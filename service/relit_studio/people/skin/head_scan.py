"""The scanned head that all skin textures come from: "Infinite, 3D Head Scan by Lee Perry-Smith" (CC-BY 3.0)."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import InputError

_TYPES = {5126: np.float32, 5123: np.uint16}
_WIDTHS = {"VEC3": 3, "VEC2": 2, "SCALAR": 1}


@dataclass(frozen=True, eq=False)
class Scan:
    """A textured surface: vertices (n, 3), texture coordinates (n, 2) with v up, triangles (m, 3)."""

    vertices: Float64Array
    uv: Float64Array
    triangles: Indices


def read_scan(path: Path) -> Scan:
    """Read the first mesh of an uncompressed binary glTF file.

    Raises:
        InputError: the file is missing or no such file.
    """
    try:
        data = path.read_bytes()
        (length,) = struct.unpack("<I", data[12:16])
        layout = json.loads(data[20 : 20 + length])
        buffer = data[28 + length :]
        primitive = layout["meshes"][0]["primitives"][0]
        position, uv = (_accessor(layout, buffer, primitive["attributes"][key]) for key in ("POSITION", "TEXCOORD_0"))
        triangles = _accessor(layout, buffer, primitive["indices"]).reshape(-1, 3)
    except (OSError, ValueError, KeyError, IndexError, struct.error) as error:
        raise InputError(f"{path} is no usable glTF file: {error}", "fetch it again") from error
    return Scan(position.astype(np.float64), uv.astype(np.float64), triangles.astype(np.intp))


def _accessor(layout: dict, buffer: bytes, index: int) -> NDArray:
    accessor = layout["accessors"][index]
    view = layout["bufferViews"][accessor["bufferView"]]
    width = _WIDTHS[accessor["type"]]
    offset = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    kind = _TYPES[accessor["componentType"]]
    return np.frombuffer(buffer, kind, accessor["count"] * width, offset).reshape(-1, width)
