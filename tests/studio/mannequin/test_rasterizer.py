from __future__ import annotations

import numpy as np

from relit_studio.mannequin.rendering.rasterizer import nearness_buffer, rasterize

RNG = np.random.default_rng(5)


def soup(count: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    points = np.concatenate([RNG.uniform(-5, size + 5, (count, 2)), RNG.uniform(1, 2, (count, 1))], axis=1)
    return points.astype(np.float32), RNG.integers(0, count, (count, 3))


def nearest_by_hand(points: np.ndarray, triangles: np.ndarray, x: float, y: float) -> float:
    """Solve each triangle's barycentric system at one point; nothing of the rasterizer is used."""
    best = -np.inf
    for corners in points[triangles].astype(np.float64):
        system = np.vstack([corners[:, :2].T, np.ones(3)])
        # Counter-clockwise with y up is clockwise with y down.
        (ax, ay), (bx, by), (cx, cy) = corners[:, :2]
        if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) >= -1e-6:
            continue
        weights = np.linalg.solve(system, [x, y, 1])
        if (weights >= 0).all():
            best = max(best, float(weights @ corners[:, 2]))
    return best


def test_every_pixel_of_random_triangles_equals_the_one_solved_alone() -> None:
    points, triangles = soup(24, 20)
    buffer = nearness_buffer(points, triangles, 20, 16)
    for row in range(16):
        for column in range(20):
            expected = nearest_by_hand(points, triangles, column + 0.5, row + 0.5)
            assert np.isclose(buffer[row, column], expected, atol=1e-4), (row, column)


def test_interpolating_the_vertices_positions_gives_the_pixel_centers() -> None:
    points, triangles = soup(60, 40)
    hits = rasterize(points, triangles, 40, 30)
    at = hits.interpolate(points)
    assert len(hits.pixels) > 300
    np.testing.assert_allclose(at[:, 0], hits.pixels % 40 + 0.5, atol=2e-3)
    np.testing.assert_allclose(at[:, 1], hits.pixels // 40 + 0.5, atol=2e-3)
    np.testing.assert_allclose(at[:, 2], nearness_buffer(points, triangles, 40, 30).ravel()[hits.pixels], atol=1e-5)


def test_more_fragments_than_fit_at_once_give_the_same_picture() -> None:
    # Layers of the whole picture: several chunks of fragments, and the nearest layer is neither first nor last.
    corners = np.array([[0, 0], [0, 600], [600, 600], [600, 0]], float)
    layers = [np.column_stack([corners, np.full(4, depth)]) for depth in (1.0, 3.0, 2.0, 0.5)]
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = np.concatenate([quad + 4 * i for i in range(4)])
    hits = rasterize(np.concatenate(layers).astype(np.float32), triangles, 600, 600)
    assert len(hits.pixels) == 600 * 600
    assert set(np.unique(hits.corners // 4)) == {1}


def test_surfaces_seen_from_behind_or_off_the_picture_are_not_there() -> None:
    triangle = np.array([[2, 2, 1], [2, 8, 1], [8, 8, 1]], np.float32)
    assert np.isfinite(nearness_buffer(triangle, np.array([[0, 1, 2]]), 10, 10)).any()
    assert not np.isfinite(nearness_buffer(triangle, np.array([[0, 2, 1]]), 10, 10)).any()
    assert len(rasterize(triangle + np.float32(50), np.array([[0, 1, 2]]), 10, 10).pixels) == 0
