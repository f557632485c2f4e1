"""Delaunay triangulation of landmarks, by OpenCV: SciPy's would cost the camera 20 MB."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Points

SPAN, MARGIN = 1000, 1_000_000
"""Units to which the points are scaled, for OpenCV's tolerances are absolute; and how far beyond them the corners lie
that it begins with: nearer ones would leave out flat triangles at the hull."""


def delaunay_triangles(points: Points) -> NDArray[np.intp]:
    """Triangles (count, 3) of indices of `points` (some, 2), sorted; of points that coincide the first is used."""
    shifted = np.asarray(points - points.min(axis=0), np.float64)
    places = (shifted * (SPAN / max(float(shifted.max()), 1e-12))).astype(np.float32)
    division = cv2.Subdiv2D()
    division.initDelaunay((-MARGIN, -MARGIN, 2 * MARGIN + SPAN + 1, 2 * MARGIN + SPAN + 1))
    index_of: dict[tuple[float, ...], int] = {}
    for index, place in enumerate(places.tolist()):
        if index_of.setdefault(tuple(place), index) == index:
            division.insert(place)
    corners = np.asarray(division.getTriangleList()).reshape(-1, 3, 2).tolist()
    # The outermost triangles have corners of OpenCV's own.
    found = [[index_of.get(tuple(corner), -1) for corner in triangle] for triangle in corners]
    inside = [sorted(triangle) for triangle in found if min(triangle) >= 0]
    return np.array(sorted(inside), np.intp).reshape(-1, 3)


def outline_edges(triangles: NDArray[np.intp]) -> NDArray[np.intp]:
    """Edges (count, 2) that belong to one triangle only: the convex hull of a Delaunay triangulation."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    count = int(triangles.max(initial=0)) + 1
    distinct, uses = np.unique(edges[:, 0] * count + edges[:, 1], return_counts=True)
    return np.column_stack(np.divmod(distinct[uses == 1], count)).astype(np.intp)
