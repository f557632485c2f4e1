"""The first-order motion graph against its formula in float64, and against motions whose flow is known."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.live.reenactment.dense_motion import DenseMotion, Influence, Region, region_around

UNIT = 40.0


@pytest.fixture(scope="module")
def motion():
    return DenseMotion(SessionOptions())


def cloud(seed: int = 1, count: int = 60):
    """Points spread over a head of two eye distances, and their reach."""
    points = np.random.default_rng(seed).uniform([20, 10], [100, 110], (count, 2))
    return points, np.full(count, 0.2 * UNIT)


def plain(target: np.ndarray, radius: np.ndarray):
    return Influence(target, target, (UNIT / radius) ** 2)


def flow_at(
    motion: DenseMotion,
    source: np.ndarray,
    target: np.ndarray,
    radius: np.ndarray,
    region: Region,
    influence: Influence | None = None,
):
    (patch,) = motion.flow(source, influence or plain(target, radius), radius, UNIT, [region])
    return patch.flow.reshape(-1, 2)


def formula(source: np.ndarray, influence: Influence, radius: np.ndarray, grid: np.ndarray):
    """Σ_k w_k(x) (s_k + A_k (x − t_k)) / Σ w − x, and a still background, as models/first_order_motion says."""
    s, t, c, x = (points / UNIT for points in (source, influence.target, influence.center, grid))
    r = radius / UNIT
    affine = []
    for i in range(len(s)):
        near = np.exp(-((c - c[i]) ** 2).sum(axis=1) / (2 * (1.2 * r[i]) ** 2))
        m = np.einsum("j,ja,jb->ab", near, s - s[i], t - t[i])
        n = np.einsum("j,ja,jb->ab", near, t - t[i], t - t[i])
        ridge = (0.05 * np.trace(n) + 2e-3) * np.eye(2)
        affine.append((m + ridge) @ np.linalg.inv(n + ridge))
    weight = influence.strength * np.exp(-((x[:, None] - c) ** 2).sum(axis=2) / (2 * r**2))
    local = s + np.einsum("kab,gkb->gka", np.array(affine), x[:, None] - t) - x[:, None]
    return UNIT * np.einsum("gk,gka->ga", weight, local) / (weight.sum(axis=1) + 1e-3)[:, None]


def test_the_graph_computes_its_formula(motion: DenseMotion) -> None:
    source, radius = cloud()
    rng = np.random.default_rng(2)
    target = source + rng.normal(0, 3, source.shape)
    influence = Influence(target, target + rng.normal(0, 2, source.shape), rng.uniform(0, 40, len(source)))
    region = Region(np.array([0.0, 0, 120, 120]), 9, 11)
    expected = formula(source, influence, radius, region.grid)
    np.testing.assert_allclose(flow_at(motion, source, target, radius, region, influence), expected, atol=0.02)


def test_no_motion_is_no_flow(motion: DenseMotion) -> None:
    source, radius = cloud()
    region = region_around(source, 20, 16, 16)
    np.testing.assert_allclose(flow_at(motion, source, source, radius, region), 0, atol=1e-3)


def test_a_shift_is_reproduced_among_the_points_and_dies_away_far_from_them(motion: DenseMotion) -> None:
    source, radius = cloud()
    region = Region(np.array([35.0, 25, 85, 95]), 12, 12)
    flow = flow_at(motion, source, source + [6, -3], radius, region)
    np.testing.assert_allclose(flow, np.broadcast_to([-6, 3], flow.shape), atol=0.05)
    far = Region(np.array([300.0, 300, 340, 340]), 4, 4)
    np.testing.assert_allclose(flow_at(motion, source, source + [6, -3], radius, far), 0, atol=1e-3)


@pytest.mark.parametrize(
    "linear",
    [
        [[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]],
        [[1.15, 0], [0, 1.15]],
        [[1.0, 0.15], [0, 0.9]],
    ],
    ids=["rotation", "growth", "shear"],
)
def test_an_affine_motion_of_the_points_is_the_flow_between_them(motion: DenseMotion, linear: np.ndarray) -> None:
    """Points move by x → B x + b; the backward flow is then B⁻¹(x − b) − x, up to the ridge toward translation."""
    source, radius = cloud()
    middle, linear, shift = np.array([60.0, 60.0]), np.array(linear), np.array([4.0, -2.0])
    target = (source - middle) @ linear.T + middle + shift
    region = Region(np.array([40.0, 30, 80, 90]), 12, 12)
    expected = (region.grid - middle - shift) @ np.linalg.inv(linear).T + middle - region.grid
    error = flow_at(motion, source, target, radius, region) - expected
    assert np.abs(expected).max() > 6
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.3
    assert np.abs(error).max() < 1.0


def test_regions_come_back_in_order(motion: DenseMotion) -> None:
    source, radius = cloud()
    regions = [Region(np.array([0.0, 0, 120, 120]), 7, 9), Region(np.array([40.0, 40, 60, 50]), 5, 6)]
    both = motion.flow(source, plain(source + [5, 0], radius), radius, UNIT, regions)
    assert [patch.flow.shape for patch in both] == [(7, 9, 2), (5, 6, 2)]
    for patch, region in zip(both, regions, strict=True):
        (alone,) = motion.flow(source, plain(source + [5, 0], radius), radius, UNIT, [region])
        np.testing.assert_array_equal(patch.region, region.box)
        np.testing.assert_allclose(patch.flow, alone.flow, atol=1e-4)


def test_a_grid_has_its_corners_at_the_boxs() -> None:
    region = region_around(np.array([[10.0, 20], [30, 60]]), 5, 4, 3)
    np.testing.assert_array_equal(region.box, [5, 15, 35, 65])
    assert region.grid.shape == (12, 2)
    np.testing.assert_array_equal(region.grid[[0, 2, -1]], [[5, 15], [35, 15], [35, 65]])
