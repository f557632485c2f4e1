"""Depth and normals of a triangle mesh as a picture sees it from the front."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array


def vertex_normals(vertices: Float64Array, triangles: NDArray[np.integer]) -> Float64Array:
    """Unit normals (count, 3) of vertices (count, 3): means over their triangles (some, 3), by area."""
    corners = vertices[triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    summed = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(summed, triangles[:, corner], faces)
    return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12))


def raster_mesh(
    positions: Float64Array, triangles: NDArray[np.integer], values: Float64Array, size: tuple[int, int]
) -> tuple[Float32Array, Float32Array]:
    """The nearest surface at each pixel's center, in parallel projection.

    Args:
        positions: (count, 3) vertices: x and y in pixels, y down, pixel centers at integers + ½; z toward the camera.
        triangles: (some, 3) vertex indices.
        values: (count, channels) interpolated over the triangles.
        size: height and width of the picture.

    Returns:
        The depth (height, width), NaN where there is no surface, and the values (height, width, channels), 0 there.
    """
    height, width = size
    depth = np.full(size, -np.inf)
    found = np.zeros((*size, values.shape[1]))
    for corners in triangles:
        (ax, ay, _), (bx, by, _), (cx, cy, _) = positions[corners]
        doubled_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        left, right = max(int(min(ax, bx, cx)), 0), min(int(max(ax, bx, cx)) + 1, width)
        top, bottom = max(int(min(ay, by, cy)), 0), min(int(max(ay, by, cy)) + 1, height)
        if left >= right or top >= bottom or abs(doubled_area) < 1e-9:
            continue
        x, y = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
        second = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / doubled_area
        third = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / doubled_area
        shares = np.stack([1 - second - third, second, third], axis=-1)
        part = slice(top, bottom), slice(left, right)
        here = shares @ positions[corners, 2]
        nearer = (shares.min(axis=-1) >= -1e-6) & (here > depth[part])
        depth[part][nearer] = here[nearer]
        found[part][nearer] = shares[nearer] @ values[corners]
    return np.where(np.isfinite(depth), depth, np.nan).astype(np.float32), found.astype(np.float32)
