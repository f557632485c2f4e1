"""The first-order motion graph against its formula in float64, and against motions whose flow is known."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.live.reenactment.dense_motion import FEATURE_LINES, HEAD_LINES, DenseMotion, Influence, box_around

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
    box: np.ndarray,
    influence: Influence | None = None,
):
    (patch,) = motion.flow(source, influence or plain(target, radius), radius, UNIT, box)
    return patch.flow.reshape(-1, 2)


def grid_of(box: np.ndarray, lines: int = HEAD_LINES):
    """Its places (lines², 2) in source pixels, the corners at the box's."""
    x, y = (np.linspace(box[i], box[i + 2], lines) for i in (0, 1))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


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
    box = np.array([0.0, 0, 120, 120])
    expected = formula(source, influence, radius, grid_of(box))
    np.testing.assert_allclose(flow_at(motion, source, target, radius, box, influence), expected, atol=1e-3)


def test_the_strong_points_of_a_slit_far_from_the_face_are_still_computed(motion: DenseMotion) -> None:
    """Each axis's Gaussian ends at a least value; what that adds far away must stay far below the background."""
    source, radius = cloud()
    radius = radius / 6
    strength = (UNIT / radius) ** 2 * np.exp(4.5)
    target = source + np.random.default_rng(2).normal(0, 2, source.shape)
    influence, box = Influence(target, target, strength), np.array([-150.0, -150, 300, 300])
    expected = formula(source, influence, radius, grid_of(box))
    np.testing.assert_allclose(flow_at(motion, source, target, radius, box, influence), expected, atol=2e-3)


def test_no_motion_is_no_flow(motion: DenseMotion) -> None:
    source, radius = cloud()
    box = box_around(source, 20)
    np.testing.assert_allclose(flow_at(motion, source, source, radius, box), 0, atol=1e-3)


def test_a_shift_is_reproduced_among_the_points_and_dies_away_far_from_them(motion: DenseMotion) -> None:
    source, radius = cloud()
    box = np.array([35.0, 25, 85, 95])
    flow = flow_at(motion, source, source + [6, -3], radius, box)
    np.testing.assert_allclose(flow, np.broadcast_to([-6, 3], flow.shape), atol=0.05)
    far = np.array([300.0, 300, 340, 340])
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
    box = np.array([40.0, 30, 80, 90])
    expected = (grid_of(box) - middle - shift) @ np.linalg.inv(linear).T + middle - grid_of(box)
    error = flow_at(motion, source, target, radius, box) - expected
    assert np.abs(expected).max() > 6
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.3
    assert np.abs(error).max() < 1.0


def test_features_come_back_in_order_and_as_the_head_has_them(motion: DenseMotion) -> None:
    source, radius = cloud()
    influence = plain(source + np.random.default_rng(2).normal(0, 3, source.shape), radius)
    head, features = np.array([0.0, 0, 120, 120]), [np.array([40.0, 40, 60, 50]), np.array([30.0, 70, 90, 110])]
    patches = motion.flow(source, influence, radius, UNIT, head, features)
    lines = [HEAD_LINES, FEATURE_LINES, FEATURE_LINES]
    for patch, box, count in zip(patches, [head, *features], lines, strict=True):
        np.testing.assert_array_equal(patch.box, box)
        assert patch.flow.shape == (count, count, 2)
        expected = formula(source, influence, radius, grid_of(box, count))
        np.testing.assert_allclose(patch.flow.reshape(-1, 2), expected, atol=1e-3)


def test_a_box_lies_round_its_points() -> None:
    np.testing.assert_array_equal(box_around(np.array([[10.0, 20], [30, 60]]), 5), [5, 15, 35, 65])
