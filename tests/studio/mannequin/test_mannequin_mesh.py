from __future__ import annotations

import numpy as np
import pytest

from relit_studio.mannequin.shape.mesh import (
    Mesh,
    extrude,
    grid_triangles,
    loop_subdivision,
    normal_operator,
    spread,
    vertex_normals,
)

OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])


def edges_of(triangles: np.ndarray) -> np.ndarray:
    half = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(half, axis=0)


def test_subdivision_of_a_closed_surface_stays_closed_and_outward() -> None:
    matrix, triangles, sharp = loop_subdivision(FACES, 6)
    vertices = matrix @ OCTAHEDRON
    assert (len(vertices), len(triangles), sharp) == (6 + 12, 32, [])
    assert len(vertices) - len(edges_of(triangles)) + len(triangles) == 2
    normals = vertex_normals(vertices, triangles, normal_operator(triangles, len(vertices)))
    assert (np.einsum("ij,ij->i", normals, vertices) > 0).all()


def test_subdivision_gives_loops_own_points() -> None:
    matrix, _, _ = loop_subdivision(FACES, 6)
    vertices = matrix @ OCTAHEDRON
    # Valence 4: 1 - 4 β with β = 3 / 32, and the four neighbors of a pole cancel out.
    np.testing.assert_allclose(vertices[4], [0, 0, 1 - 4 * 3 / 32])
    # The middle of edge (1,0,0)-(0,1,0): 3/8 of each, and the poles' eighths cancel.
    assert np.abs(vertices - [3 / 8, 3 / 8, 0]).sum(axis=1).min() < 1e-12
    np.testing.assert_allclose(np.asarray(matrix.sum(axis=1)).ravel(), 1)


def test_border_of_a_subdivided_sheet_stays_straight_and_its_plane_flat() -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    sheet = np.stack([x.ravel(), -y.ravel(), 0.5 * x.ravel() + 2], axis=1)
    matrix, triangles, _ = loop_subdivision(grid_triangles(3, 4), 12)
    fine = matrix @ sheet
    np.testing.assert_allclose(fine[:, 2], 0.5 * fine[:, 0] + 2)
    assert (fine[:, :2].min(axis=0) >= [0, -2]).all()
    assert (fine[:, :2].max(axis=0) <= [3, 0]).all()
    assert np.isclose(fine[:, 1], 0).sum() == 5  # two and three new between them; the corners are rounded
    assert len(triangles) == 4 * 12


def test_sharp_edges_follow_the_cubic_curve_of_themselves_alone() -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
    bump = np.stack([x.ravel(), -y.ravel(), (y.ravel() == 2) * 1.0], axis=1)
    ridge = [(10 + i, 11 + i) for i in range(4)]
    sharp, _, fine_ridge = loop_subdivision(grid_triangles(5, 5), 25, ridge)
    smooth, _, _ = loop_subdivision(grid_triangles(5, 5), 25)
    assert (sharp @ bump)[12, 2] == pytest.approx(1)
    assert (smooth @ bump)[12, 2] < 0.9
    assert len(fine_ridge) == 8


def test_grid_faces_outward_also_when_coarser() -> None:
    angle = np.linspace(-np.pi, np.pi, 12, endpoint=False)
    tube = np.stack(
        [np.tile(np.sin(angle), 5), np.repeat(-np.arange(5.0), 12), np.tile(np.cos(angle), 5)],
        axis=1,
    )
    for step in (1, 3):
        triangles = grid_triangles(5, 12, closed=True, step=step)
        a, b, c = (tube[triangles[:, i]] for i in range(3))
        outward = np.cross(b - a, c - a)
        assert (np.einsum("ij,ij->i", outward, (a + b + c) * [1, 0, 1]) > 0).all()
    assert len(grid_triangles(5, 12, closed=True, step=3)) < len(grid_triangles(5, 12, closed=True)) / 3


@pytest.mark.parametrize("direction", [1, -1])
def test_extruding_a_border_closes_it_with_consistent_winding(direction: int) -> None:
    open_box = Mesh(OCTAHEDRON[:5], FACES[:4])
    rim = [0, 2, 1, 3][::direction]
    closed = extrude(open_box, rim, [OCTAHEDRON[rim] - [0, 0, 0.5]], cap=[0, 0, -1])
    half = [tuple(edge) for edge in closed.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()]
    assert len(set(half)) == len(half)
    assert {(b, a) for a, b in half} == set(half)


def test_spread_keeps_handles_and_stays_between_them() -> None:
    triangles = grid_triangles(6, 9)
    fixed = {0: [0.0], 8: [1.0], 53: [0.5]}
    values = spread(triangles, 54, fixed)
    assert [values[i, 0] for i in fixed] == [0, 1, 0.5]
    others = np.delete(values[:, 0], list(fixed))
    assert (others > 0).all()
    assert (others < 1).all()
    smooth = spread(triangles, 54, fixed, order=2)
    assert smooth[53, 0] == 0.5
