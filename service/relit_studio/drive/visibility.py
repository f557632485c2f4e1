"""Which share of a face the camera sees: not what is covered, and not what lies outside the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_studio.camera import Camera
from relit_studio.mannequin.raster import nearness_buffer
from relit_studio.people.geometry import Floats, Indices

_HEIGHT = 180
"""Of the picture in which it is measured, pixels."""
_WIDER = 5
"""It is so many times as wide as the camera's, so that who has left it sideways, as people do, is there still."""
_SLACK_CM = 0.3
"""What lies no farther behind another surface counts as touching it."""

Surface = tuple[Floats, Indices]
"""Vertices (n, 3) in room axes and triangles (m, 3)."""


@dataclass(frozen=True, eq=False)
class Visibility:
    """What can be seen of a face.

    Attributes:
        covered_share: of the face's side toward the camera, what something else is before.
        visible_share: of it, what is neither covered nor outside the picture.
        hidden: (count,) which of the points are covered or outside the picture.
    """

    covered_share: float
    visible_share: float
    hidden: NDArray[np.bool_]


def visibility(camera: Camera, face: Surface, before: Sequence[Surface], points: Floats) -> Visibility:
    """See how much of a face is visible.

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
        covered_share=float(covered.sum() / total),
        visible_share=float((seen & inside & ~covered).sum() / total),
        hidden=_hidden(wide, points, cover) | ~_within(camera, points),
    )


def _nearness(camera: Camera, surface: Surface) -> NDArray[np.float32]:
    """1 / distance along the axis (rows, columns) of the surface's nearest part; -inf where there is none."""
    vertices, triangles = surface
    points = np.column_stack([camera.project(vertices), 1 / (camera.distance_cm - vertices[:, 2])])
    return nearness_buffer(points.astype(np.float32), triangles.astype(np.int64), *camera.size)


def _hidden(camera: Camera, points: Floats, cover: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether something is before each point (count,)."""
    rows, columns = cover.shape
    x, y = camera.project(points).astype(int).T
    nearest = cover[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)]
    return np.asarray(nearest > 1 / (camera.distance_cm - points[:, 2] - _SLACK_CM))


def _within(camera: Camera, points: Floats) -> NDArray[np.bool_]:
    x, y = camera.project(points).T
    width, height = camera.size
    return np.asarray((x >= 0) & (x < width) & (y >= 0) & (y < height))
