"""Meshes and strands as Blender objects, and their changes between pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from relit_studio.cycles.worker.axes import matrix_to_blender, to_blender
from relit_studio.cycles.worker.nodes import REST

Arrays = Mapping[str, NDArray]
"""Arrays by "object.field"."""


def add_mesh(description: Mapping[str, Any], arrays: Arrays, materials: Mapping[str, Any]) -> None:
    """Add a mesh; faces (n, 4) hold -1 in their last column where they are triangles."""
    name = description["name"]
    faces = arrays[f"{name}.faces"]
    polygons = [[int(index) for index in face if index >= 0] for face in faces]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(to_blender(arrays[f"{name}.vertices"]).tolist(), [], polygons)
    if f"{name}.uv" in arrays:
        corners = np.empty(len(mesh.loops), np.int32)
        mesh.loops.foreach_get("vertex_index", corners)
        layer = mesh.uv_layers.new(name="uv")
        layer.data.foreach_set("uv", arrays[f"{name}.uv"][corners].astype(np.float32).ravel())
    mesh.attributes.new(REST, "FLOAT_VECTOR", "POINT").data.foreach_set(
        "vector", to_blender(arrays[f"{name}.vertices"]).astype(np.float32).ravel()
    )
    for attribute in description["attributes"]:
        data = mesh.attributes.new(attribute, "FLOAT", "POINT").data
        data.foreach_set("value", arrays[f"{name}.{attribute}"].astype(np.float32))
    _add_materials(mesh, description["materials"], materials)
    mesh.polygons.foreach_set("material_index", arrays[f"{name}.slots"].astype(np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(polygons), bool))
    mesh.update()
    placed = _link(name, mesh)
    if description["subdivision"]:
        modifier = placed.modifiers.new("subdivision", "SUBSURF")
        modifier.levels, modifier.render_levels = 0, description["subdivision"]
        modifier.boundary_smooth = "PRESERVE_CORNERS"


def add_strands(description: Mapping[str, Any], arrays: Arrays, materials: Mapping[str, Any]) -> None:
    """Add hair curves of equally many points each."""
    name = description["name"]
    points, radius = arrays[f"{name}.points"], arrays[f"{name}.radius"]
    curves = bpy.data.hair_curves.new(name)
    curves.add_curves([points.shape[1]] * len(points))
    curves.attributes["position"].data.foreach_set("vector", to_blender(points).ravel())
    widths = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    widths.data.foreach_set("value", radius.astype(np.float32).ravel())
    shades = curves.attributes.new("shade", "FLOAT", "CURVE")
    shades.data.foreach_set("value", arrays[f"{name}.shade"].astype(np.float32))
    _add_materials(curves, description["materials"], materials)
    _link(name, curves)


def reshape(arrays: Arrays) -> None:
    """Apply changed geometry: "object.vertices", "object.points", or "object.matrix" (4, 4) in room axes."""
    for key, values in arrays.items():
        name, field = key.split(".")
        placed = bpy.data.objects[name]
        if field == "matrix":
            placed.matrix_world = Matrix(matrix_to_blender(values).tolist())
        elif field == "vertices":
            placed.data.vertices.foreach_set("co", to_blender(values).ravel())
            placed.data.update()
        else:
            placed.data.attributes["position"].data.foreach_set("vector", to_blender(values).ravel())
            placed.data.update_tag()


def _add_materials(data: Any, names: Sequence[str], materials: Mapping[str, Any]) -> None:
    for name in names:
        data.materials.append(materials[name])


def _link(name: str, data: Any) -> Any:
    placed = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(placed)
    return placed
