"""Shadow map of a point light."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_studio.mannequin.rendering.rasterizer import nearness_buffer
from relit_studio.mannequin.rendering.shading import LIFT, axes_along, lit_fraction
from relit_studio.mannequin.shape.mesh import Triangles

Values = NDArray[np.float32]


class PointShadow:
    """Shadow map of a point light: perspective depth from its position (Williams 1978)."""

    def __init__(self, vertices: Values, triangles: Triangles, light: ArrayLike, size: int) -> None:
        """See `vertices` (count, 3) from a light at (3,), outside of them all, at size x size texels."""
        self._light = np.asarray(light, np.float32)
        toward = np.asarray(light, np.float64) - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        right, down, back = axes_along(toward / np.linalg.norm(toward))
        self._axes = np.stack([right, down, -back])
        x, y, distance = self._seen(vertices)
        low, high = (np.array([f(x), f(y)]) for f in (np.min, np.max))
        self._texel = float((high - low).max()) / (size - 2)
        self._origin = low - self._texel
        self._nearness = nearness_buffer(self._texels(x, y, distance), triangles, size, size)

    def lit(self, positions: Values, normals: Values) -> Values:
        """Share 0..1 (count,) of the light that reaches points with unit normals (count, 3)."""
        distance = self._seen(positions)[2]
        lifted = positions + normals * (np.float32(LIFT * self._texel) * distance)[:, None]
        x, y, nearness = self._texels(*self._seen(lifted)).T
        return lit_fraction(self._nearness, x, y, nearness)

    def _seen(self, points: Values) -> tuple[Values, Values, Values]:
        """Slopes to the right and down, and the distance along the axis, of points (count, 3)."""
        across, down, distance = self._axes @ (points - self._light).T
        return across / distance, down / distance, distance

    def _texels(self, x: Values, y: Values, distance: Values) -> Values:
        """Points (count, 3) as `nearness_buffer` wants them."""
        scale = np.float32(1 / self._texel)
        left, top = (np.float32(value) for value in self._origin)
        return np.stack([(x - left) * scale, (y - top) * scale, 1 / distance], axis=1)
