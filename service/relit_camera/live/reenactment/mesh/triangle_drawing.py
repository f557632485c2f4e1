"""Drawing triangles with values that are interpolated between their corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ON_BORDER = 1e-5
"""Share of a triangle by which a point beyond it still counts as on its border, so that rounding opens no seam."""


def draw_triangles(
    corners: NDArray[np.float64], values: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float32]:
    """Triangles drawn over each other in their order, with values interpolated between corners, 0 where there is none.

    A point shows the last triangle that it lies in; pixel (row, column) stands for the point (column, row).

    Args:
        corners: (triangles, 3, 2) columns and rows.
        values: (triangles, 3, channels).
        shape: (rows, columns) of the picture to draw.

    Returns:
        (channels, rows, columns) float32.
    """
    rows, columns = shape
    (x, y), (ax, ay), (bx, by) = np.ascontiguousarray(corners.transpose(1, 2, 0))
    first_row = np.maximum(np.ceil(np.minimum(np.minimum(y, ay), by)), 0)
    last_row = np.minimum(np.floor(np.maximum(np.maximum(y, ay), by)), rows - 1)
    ax, ay, bx, by = ax - x, ay - y, bx - x, by - y
    area = ax * by - ay * bx
    flat = area == 0  # such a triangle shows nowhere
    area[flat] = 1
    # The corners' weights, and what is interpolated by them, are planes over the picture: the change a column, the
    # change a row, and the value at column 0 of row 0; (3 of these, corners or channels, triangles).
    weights = np.empty((3, 3, len(corners)))
    weights[:2, 1] = by / area, -bx / area
    weights[:2, 2] = -ay / area, ax / area
    weights[2, 1:] = -(weights[0, 1:] * x + weights[1, 1:] * y)
    weights[:, 0] = -(weights[:, 1] + weights[:, 2])
    weights[2, 0] += 1
    base, second, third = np.ascontiguousarray(values.transpose(1, 2, 0))
    planes = weights[:, None, 1] * (second - base) + weights[:, None, 2] * (third - base)
    planes[2] += base
    lines = np.maximum(last_row - first_row + 1, 0)
    lines[flat] = 0
    lines = lines.astype(np.intp)
    # In each line of nodes a triangle shows from where the last of its weights gets positive to where the first ends.
    triangle = np.repeat(np.arange(len(lines)), lines)
    line = np.arange(len(triangle)) + (first_row - (np.cumsum(lines) - lines)).take(triangle)
    slope, down, start = weights
    slope[slope == 0] = np.finfo(np.float64).tiny ** 0.5
    ends = np.concatenate([(-ON_BORDER - start) / slope, down / slope]).take(triangle, axis=1)
    end = ends[:3] - ends[3:] * line
    rising = (slope > 0).take(triangle, axis=1)
    left = np.ceil(np.where(rising, end, 0).max(axis=0).clip(0, columns))
    right = np.floor(np.where(rising, columns - 1, end).min(axis=0).clip(-1, columns - 1))
    count = np.maximum(right - left + 1, 0).astype(np.intp)
    across, downward, origin = planes.take(triangle, axis=2)
    begin = origin + across * left + downward * line
    span = np.repeat(np.arange(len(count)), count)
    along = np.arange(len(span)) - (np.cumsum(count) - count).take(span)
    place = (line * columns + left).astype(np.intp).take(span) + along
    shown = across.astype(np.float32).take(span, axis=1)
    shown *= along.astype(np.float32)
    shown += begin.astype(np.float32).take(span, axis=1)
    drawn = np.zeros((len(planes[0]), rows * columns), np.float32)
    for channel, value in zip(drawn, shown, strict=True):
        channel[place] = value  # where a place is given several times the last value stays
    return drawn.reshape(-1, rows, columns)


def doubled_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas (count,) of triangles (count, 3, 2), doubled."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.asarray(ax * by - ay * bx)
