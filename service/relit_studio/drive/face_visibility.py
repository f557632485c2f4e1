"""Visible fraction of a face: the part that is neither occluded nor outside the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_studio.cameras.studio_camera import Camera
from relit_studio.mannequin.rendering.rasterizer import nearness_buffer

_HEIGHT = 180
"""Height of the depth picture in which visibility is measured, pixels."""
_WIDER = 5
"""Width of the depth picture relative to the camera's, so that it still contains people who left sideways."""
_SLACK_CM = 0.3
"""Largest depth behind another surface at which a point still counts as visible."""

Surface = tuple[Float64Array, Indices]
"""Vertices (n, 3) in room axes and triangles (m, 3)."""


@dataclass(frozen=True, eq=False)
class Visibility:
    """Visibility of a face.

    Attributes:
        covered_fraction: occluded fraction of the face's side toward the camera.
        visible_fraction: fraction of that side that is neither occluded nor outside the picture.
        hidden: (count,) which points are occluded or outside the picture.
    """

    covered_fraction: float
    visible_fraction: float
    hidden: NDArray[np.bool_]


def visibility(camera: Camera, face: Surface, before: Sequence[Surface], points: Float64Array) -> Visibility:
    """Measure how much of a face is visible.

    Args:
        camera: the picture's.
        face: whose own back and folds do not count as covered.
        before: what may cover it.
        points: (count, 3) on the face, room axes.
    """
    width, height = camera.size
    inner = round(_HEIGHT * width / height)
    wide = replace(camera, height=_HEIGHT, width=_WIDER * inner)
    nearest = _nearness(wide, face)
    covers = [_nearness(wide, surface) for surface in before]
    cover = np.max(covers, axis=0) if covers else np.full_like(nearest, -np.inf)
    seen = np.isfinite(nearest)
    covered = seen & (cover > nearest)
    inside = np.zeros_like(seen)
    inside[:, (_WIDER // 2) * inner : (_WIDER // 2 + 1) * inner] = True
    total = max(int(seen.sum()), 1)
    return Visibility(
        covered_fraction=float(covered.sum() / total),
        visible_fraction=float((seen & inside & ~covered).sum() / total),
        hidden=_hidden(wide, points, cover) | ~_within(camera, points),
    )


def _nearness(camera: Camera, surface: Surface) -> NDArray[np.float32]:
    """Inverse depth (rows, columns) of the nearest surface; -inf where there is none."""
    vertices, triangles = surface
    points = np.column_stack([camera.project(vertices), 1 / (camera.distance_cm - vertices[:, 2])])
    return nearness_buffer(points.astype(np.float32), triangles.astype(np.int64), *camera.size)


def _hidden(camera: Camera, points: Float64Array, cover: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which points (count,) are occluded."""
    rows, columns = cover.shape
    x, y = camera.project(points).astype(int).T
    nearest = cover[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)]
    return np.asarray(nearest > 1 / (camera.distance_cm - points[:, 2] - _SLACK_CM))


def _within(camera: Camera, points: Float64Array) -> NDArray[np.bool_]:
    x, y = camera.project(points).T
    width, height = camera.size
    return np.asarray((x >= 0) & (x < width) & (y >= 0) & (y < height))
