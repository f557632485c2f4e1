"""Pictures and coordinates of light maps for a field's report."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.capture.reflectance.delaunay_triangulation import spherical_delaunay
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, map_position_from_direction

_GAP = 4
"""Pixels between the rows of a grid."""
_UNKNOWN_COLOR = (86, 96, 110)
"""Where a map has no value."""
_SCAN_LINE_COLOR = (255, 220, 0)
_ARC_POINTS = 9
"""Points that an edge between two lights is drawn through."""


def values_on_light_map(truth: GroundTruth, values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Values (lights, ...) of the truth's lights spread over the light map (32, 64, ...); NaN where it has none."""
    chosen = np.asarray(values[np.maximum(truth.light_of_texel, 0)], np.float64)
    chosen[truth.light_of_texel < 0] = np.nan
    return chosen.reshape(MAP_HEIGHT, MAP_WIDTH, *values.shape[1:])


def reflectance_picture(values: NDArray[np.floating], peak: float) -> DisplayImage:
    """Picture of a reflectance map (32, 64, 3) of linear colors; `peak` is white, NaN is gray."""
    shown = uint8_from_linear(np.asarray(values / (peak if peak > 0 else 1.0), np.float32))
    shown[np.isnan(values).any(axis=2)] = _UNKNOWN_COLOR
    return shown


def labeled_grid(pictures: Sequence[DisplayImage], names: Sequence[str], columns: int, cell_width: int) -> DisplayImage:
    """Pictures of one shape in rows of `columns`, each with its name above it."""
    sheets = [
        contact_sheet([pictures[start : start + columns]], (), names[start : start + columns], cell_width)
        for start in range(0, len(pictures), columns)
    ]
    width = max(sheet.shape[1] for sheet in sheets)
    paper = sheets[0][0, 0].tolist()
    return np.concatenate(
        [
            cv2.copyMakeBorder(sheet, 0, _GAP, 0, width - sheet.shape[1], cv2.BORDER_CONSTANT, value=paper)
            for sheet in sheets
        ]
    )


def with_scan_line(image: DisplayImage, row: int) -> DisplayImage:
    """A copy of the picture with a thin dashed line along pixel row `row`."""
    marked = image.copy()
    marked[row, ::2] = _SCAN_LINE_COLOR
    return marked


def map_pixels(directions: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """Row and column (count, 2) of unit vectors (count, 3) on a light map of `size` (height, width)."""
    return np.stack(map_position_from_direction(directions, *size), axis=-1)


def triangle_edges(directions: NDArray[np.float64], size: tuple[int, int]) -> list[NDArray[np.float64]]:
    """Edges of the Delaunay triangles of unit vectors (lights, 3) on a light map of `size` (height, width).

    Returns:
        For each edge rows and columns (points, 2) of the great-circle arc; NaN where the arc crosses the map's seam.
    """
    triangles = spherical_delaunay(directions)
    pairs = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    fractions = np.linspace(0, 1, _ARC_POINTS)[:, None]
    edges = []
    for start, end in pairs:
        edge = map_pixels(directions[start] * (1 - fractions) + directions[end] * fractions, size)
        edge[1:][np.abs(np.diff(edge[:, 1])) > size[1] / 2] = np.nan
        edges.append(edge)
    return edges
