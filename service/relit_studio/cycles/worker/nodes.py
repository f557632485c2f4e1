"""Helper to write material node trees."""

from __future__ import annotations

from typing import Any

import bpy

Socket = Any
"""bpy.types.NodeSocket."""
REST = "rest"
"""Vertex attribute with the positions that vertices had when the scene was built."""


class Nodes:
    """The node tree of one new material."""

    def __init__(self, name: str) -> None:
        """Make an empty material called `name`."""
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self._output = self.tree.nodes.new("ShaderNodeOutputMaterial")

    def add(self, kind: str, /, inputs: dict[str | int, Any] | None = None, **options: Any) -> Any:
        """Add a node: `options` are its properties, `inputs` values or sockets by name or index."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in options.items():
            setattr(node, name, value)
        for key, value in (inputs or {}).items():
            self.connect(value, node.inputs[key])
        return node

    def connect(self, value: Any, socket: Socket) -> None:
        """Link a socket, or set a constant; a color may have three parts."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif isinstance(value, (tuple, list)) and socket.type == "RGBA" and len(value) == 3:
            socket.default_value = (*value, 1)
        else:
            socket.default_value = value

    def math(self, operation: str, first: Any, second: Any) -> Socket:
        """The result of one of Blender's Math operations."""
        return self.add("Math", {0: first, 1: second}, operation=operation).outputs[0]

    def scaled_sum(self, start: float, *terms: tuple[Socket, float]) -> Socket:
        """`start` + Σ socket · factor."""
        total: Any = start
        for socket, factor in terms:
            total = self.math("ADD", self.math("MULTIPLY", socket, factor), total)
        return total

    def attribute(self, name: str) -> Socket:
        """A vertex attribute of one float."""
        return self.add("Attribute", attribute_name=name).outputs["Fac"]

    def position(self) -> Socket:
        """Surface coordinates of the scene as built, so that textures move with the surface."""
        return self.add("Attribute", attribute_name=REST).outputs["Vector"]

    def picture(self, path: str, *, linear: bool = False) -> Socket:
        """A picture file's color at the mesh's texture coordinates."""
        image = bpy.data.images.load(path, check_existing=True)
        if linear:
            image.colorspace_settings.name = "Non-Color"
        where = self.add("UVMap", uv_map="uv").outputs[0]
        return self.add("TexImage", {"Vector": where}, image=image, interpolation="Cubic").outputs["Color"]

    def mix_color(self, factor: Any, first: Any, second: Any, blend: str = "MIX") -> Socket:
        """Two colors mixed."""
        node = self.tree.nodes.new("ShaderNodeMix")
        # The sockets by these names change with the type.
        node.data_type, node.blend_type = "RGBA", blend
        for name, value in (("Factor", factor), ("A", first), ("B", second)):
            self.connect(value, node.inputs[name])
        return node.outputs["Result"]

    def mix_shader(self, factor: Any, first: Socket, second: Socket) -> Socket:
        """Two shaders mixed."""
        return self.add("MixShader", {0: factor, 1: first, 2: second}).outputs[0]

    def finish(self, shader: Socket) -> Any:
        """Make `shader` the surface and return the material."""
        self.tree.links.new(shader, self._output.inputs["Surface"])
        return self.material
