"""The triangulation of landmarks, against SciPy's Qhull."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.landmarks.landmark_triangulation import delaunay_triangles, outline_edges


def as_sets(rows: NDArray) -> set[frozenset[int]]:
    return {frozenset(map(int, row)) for row in rows}


@pytest.mark.parametrize("scale", [0.01, 1.0, 300.0])
@pytest.mark.parametrize("seed", range(5))
def test_triangles_and_hull_are_those_of_qhull(seed: int, scale: float) -> None:
    points = np.random.default_rng(seed).uniform(-scale, 2 * scale, (478, 2)).astype(np.float32)
    expected, found = Delaunay(points.astype(np.float64)), delaunay_triangles(points)
    assert as_sets(found) == as_sets(expected.simplices)
    assert as_sets(outline_edges(found)) == as_sets(expected.convex_hull)


def test_a_face_seen_from_the_front() -> None:
    points = landmark_scheme("mesh478").canonical[:, :2].astype(np.float32)
    assert as_sets(delaunay_triangles(points)) == as_sets(Delaunay(points.astype(np.float64)).simplices)


def test_points_that_coincide_count_once() -> None:
    """Closed lids and lips of a coarse tracker."""
    points = np.array([[0, 0], [4, 0], [1, 3], [4, 0], [0, 0]], np.float32)
    np.testing.assert_array_equal(delaunay_triangles(points), [[0, 1, 2]])
