"""Delaunay triangulation of the sampled directions on the sphere, and barycentric weights in its triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from relit_camera.base.errors import LightsError
from relit_camera.subject.measured_light import MAX_GAP_DEG

TOLERANCE = np.radians(0.1)
"""Directions this far outside the sampled region, in radians, count as on its edge: files round directions."""


@dataclass(frozen=True)
class TriangleLookup:
    """Triangles of captured lights that contain some query directions, and the barycentric weights there.

    Attributes:
        covered: (count,) indices of the queries that lie in a triangle.
        corners: (count, 3) indices of the lights at the triangle's corners.
        weights: (count, 3) float32, barycentric coordinates of the query in its triangle; they sum to 1.
    """

    covered: NDArray[np.intp]
    corners: NDArray[np.intp]
    weights: NDArray[np.float32]


def find_triangles(
    directions: NDArray[np.float64], queries: NDArray[np.float64], max_gap_deg: float = MAX_GAP_DEG
) -> TriangleLookup:
    """The spherical Delaunay triangle of unit vectors (lights, 3) in which each query (count, 3) lies.

    Raises:
        LightsError: fewer than four directions, or all on one circle.
    """
    triangles = spherical_delaunay(directions, max_gap_deg)
    corners = directions[triangles]
    # A direction is inside a triangle if it is on the inner side of all three great circles of its edges.
    edges = np.cross(corners, np.roll(corners, -1, axis=1))
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    inside = np.einsum("tec,qc->qte", edges, queries).min(axis=2)
    # A direction on an edge or a vertex lies in several triangles; all give it the same weights.
    chosen = inside.argmax(axis=1)
    covered = np.flatnonzero(inside[np.arange(len(queries)), chosen] >= -TOLERANCE)
    vertices = triangles[chosen[covered]]
    weights = spherical_barycentric(queries[covered], directions[vertices])
    return TriangleLookup(covered, vertices, weights.astype(np.float32))


def spherical_delaunay(directions: NDArray[np.float64], max_gap_deg: float = MAX_GAP_DEG) -> NDArray[np.intp]:
    """Delaunay triangles (count, 3) of unit vectors (lights, 3), counter-clockwise seen from outside.

    The faces of the convex hull of points on a sphere are their Delaunay triangulation. A face whose circumscribed
    circle is wider than `max_gap_deg` (angular radius) closes the part of the sphere that was not sampled: left out.

    Raises:
        LightsError: fewer than four directions, or all on one circle.
    """
    try:
        hull = ConvexHull(directions)
    except (QhullError, ValueError) as error:
        raise degenerate_directions_error(len(directions)) from error
    triangles = hull.simplices
    outward = hull.equations[:, :3]
    corners = directions[triangles]
    turned = np.einsum("tc,tc->t", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), outward) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    radius = np.arccos(np.clip(-hull.equations[:, 3], -1, 1))
    kept = triangles[radius <= np.radians(max_gap_deg)]
    if not len(kept):
        raise degenerate_directions_error(len(directions))
    return np.asarray(kept, dtype=np.intp)


def spherical_barycentric(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Barycentric weights (count, 3) of unit vectors (count, 3) in spherical triangles (count, 3, 3).

    Each weight is the area of the sub-triangle opposite to its corner over the sum of the three; they sum to 1.
    """
    areas = np.stack([_area(points, corners[:, (i + 1) % 3], corners[:, (i + 2) % 3]) for i in range(3)], axis=1)
    areas = np.maximum(areas, 0)
    return np.asarray(areas / np.maximum(areas.sum(axis=1, keepdims=True), 1e-300))


def _area(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed solid angle of spherical triangles (van Oosterom and Strackee 1983)."""
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
    return np.asarray(2 * np.arctan2(volume, 1 + ab + bc + ca))


def degenerate_directions_error(count: int) -> LightsError:
    """The error for `count` directions that cannot be triangulated."""
    return LightsError(f"{count} light directions span no region", "at least four, not all on one circle, are needed")
