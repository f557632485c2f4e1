"""Vectorized z-buffer: the visible triangle of each pixel, and the barycentric weights on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_studio.mannequin.shape.mesh import Triangles

_CHUNK = 1 << 19
"""Fragments tested at a time: few enough to stay in the processor's cache, enough to hide numpy's calls."""


@dataclass(frozen=True, eq=False)
class Hits:
    """The covered pixels of a picture, in order.

    Attributes:
        pixels: (count,) flat pixel index.
        corners: (count, 3) vertex indices of the triangle seen there.
        weights: (count, 3) float32 barycentric weights of these vertices, on the screen.
    """

    pixels: NDArray[np.int64]
    corners: NDArray[np.int64]
    weights: NDArray[np.float32]

    def interpolate(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (count, k) at the hits of values (vertices, k)."""
        result = self.weights[:, :1] * values[self.corners[:, 0]]
        for corner in (1, 2):
            result += self.weights[:, corner : corner + 1] * values[self.corners[:, corner]]
        return result


def nearness_buffer(points: NDArray[np.float32], triangles: Triangles, width: int, height: int) -> NDArray[np.float32]:
    """Nearness (height, width) of the nearest front-facing surface, -inf where there is none.

    Args:
        points: (vertices, 3) x and y in pixels, centers at integers + ½, y down; and nearness, which must be linear on
            the screen: 1 / distance under perspective, the distance itself, negated, without.
        triangles: vertex indices, counter-clockwise from outside.
        width: of the picture in pixels.
        height: of the picture in pixels.
    """
    buffer = np.full(width * height, -np.inf, np.float32)
    for pixels, nearness, _, _ in fragments(points, triangles, width, height):
        np.maximum.at(buffer, pixels, nearness)
    return buffer.reshape(height, width)


def rasterize(points: NDArray[np.float32], triangles: Triangles, width: int, height: int) -> Hits:
    """The hits of the nearest front-facing surface; arguments as `nearness_buffer`."""
    buffer = np.full(width * height, -np.inf, np.float32)
    seen = np.zeros(width * height, np.int64)
    weights = np.zeros((width * height, 2), np.float32)
    for pixels, nearness, index, weight in fragments(points, triangles, width, height):
        np.maximum.at(buffer, pixels, nearness)
        nearest = nearness == buffer[pixels]
        seen[pixels[nearest]] = index[nearest]
        weights[pixels[nearest]] = weight[nearest]
    covered = np.flatnonzero(np.isfinite(buffer))
    first, second = weights[covered].T
    return Hits(covered, triangles[seen[covered]], np.stack([first, second, 1 - first - second], axis=1))


def fragments(
    points: NDArray[np.float32], triangles: Triangles, width: int, height: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int64], NDArray[np.float32]]]:
    """Pixel, nearness, triangle and first two weights of the pixel centers that lie in front-facing triangles."""
    x, y, z = points.T
    (xa, xb, xc), (ya, yb, yc) = x[triangles].T, y[triangles].T
    # Twice the area; y runs down, so a triangle that faces the viewer has it positive with this sign.
    area = (xc - xa) * (yb - ya) - (xb - xa) * (yc - ya)
    left = np.ceil(np.minimum(np.minimum(xa, xb), xc) - 0.5).clip(0, width).astype(np.int64)
    right = np.floor(np.maximum(np.maximum(xa, xb), xc) - 0.5).clip(-1, width - 1).astype(np.int64)
    top = np.ceil(np.minimum(np.minimum(ya, yb), yc) - 0.5).clip(0, height).astype(np.int64)
    bottom = np.floor(np.maximum(np.maximum(ya, yb), yc) - 0.5).clip(-1, height - 1).astype(np.int64)
    columns, rows = right - left + 1, bottom - top + 1
    facing = np.flatnonzero((area > 1e-6) & (columns > 0) & (rows > 0))
    if facing.size == 0:
        return
    left, top, columns, area = left[facing], top[facing], columns[facing], area[facing]
    sizes = columns * rows[facing]
    xa, ya, xb, yb, xc, yc = (value[facing] for value in (xa, ya, xb, yb, xc, yc))
    za, zb, zc = z[triangles[facing]].T
    # Weight of the first corner: linear in x and y, so three numbers a triangle; of the second likewise.
    slopes = np.stack([(yb - yc) / area, (xc - xb) / area, (yc - ya) / area, (xa - xc) / area], axis=1) * np.float32(-1)
    per_triangle = np.concatenate([slopes, np.stack([xc, yc, za - zc, zb - zc, zc], axis=1)], axis=1)

    ends = np.cumsum(sizes)
    cuts = np.unique(np.searchsorted(ends, np.arange(_CHUNK, ends[-1] + _CHUNK, _CHUNK)).clip(max=len(ends) - 1) + 1)
    start = 0
    for stop in cuts.tolist():
        size = sizes[start:stop]
        which = np.repeat(np.arange(start, stop), size)
        inside_box = np.arange(len(which)) - np.repeat(np.cumsum(size) - size, size)
        row, column = np.divmod(inside_box, columns[which])
        px, py = column + left[which], row + top[which]
        ax, ay, bx, by, x0, y0, dza, dzb, z0 = per_triangle[which].T
        dx, dy = (px + np.float32(0.5)).astype(np.float32) - x0, (py + np.float32(0.5)).astype(np.float32) - y0
        wa, wb = ax * dx + ay * dy, bx * dx + by * dy
        inside = np.flatnonzero((wa >= 0) & (wb >= 0) & (wa + wb <= 1))
        wa, wb = wa[inside], wb[inside]
        nearness = wa * dza[inside] + wb * dzb[inside] + z0[inside]
        yield (py * width + px)[inside], nearness, facing[which[inside]], np.stack([wa, wb], axis=1)
        start = stop
