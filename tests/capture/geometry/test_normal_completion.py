"""Normals for the pixels that have none of their own."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.geometry.normal_completion import complete_normals, pull_push_fill
from tests.capture.geometry.shapes import angles_deg, ball


def test_a_hole_is_filled_from_around_it() -> None:
    truth, matte = ball(64)
    confidence = matte.copy()
    confidence[24:36, 24:36] = 0
    wrong = truth.copy()
    wrong[24:36, 24:36] = (1, 0, 0)
    found = complete_normals(wrong, confidence, matte)
    hole = np.zeros(matte.shape, bool)
    hole[24:36, 24:36] = True
    assert angles_deg(found, truth, hole).max() < 12
    np.testing.assert_allclose(found[~hole & (matte > 0)], truth[~hole & (matte > 0)], atol=0.03)


def test_the_outline_tells_which_way_a_body_turns() -> None:
    truth, matte = ball(64)
    found = complete_normals(np.zeros_like(truth), np.zeros_like(matte), matte)
    np.testing.assert_allclose(np.linalg.norm(found, axis=2), 1, atol=1e-5)
    assert angles_deg(found, truth, matte > 0).mean() < 18
    rim = (matte > 0) & (truth[..., 2] < 0.35)
    assert angles_deg(found, truth, rim).mean() < 12


def test_the_border_of_the_picture_is_no_outline() -> None:
    everywhere = np.ones((24, 24), np.float32)
    found = complete_normals(np.zeros((24, 24, 3), np.float32), np.zeros((24, 24), np.float32), everywhere)
    np.testing.assert_allclose(found, np.tile([0, 0, 1], (24, 24, 1)))


def test_what_is_seen_faces_the_camera() -> None:
    away = np.tile(np.array([0.8, 0, -0.6], np.float32), (16, 16, 1))
    found = complete_normals(away, np.ones((16, 16), np.float32), np.ones((16, 16), np.float32))
    assert found[..., 2].min() > 0
    assert found[..., 0].min() > 0.9


def test_filling_keeps_what_is_known_and_a_constant() -> None:
    values = np.full((9, 13, 2), 3.0, np.float32)
    values[4, 4] = 7
    weight = np.zeros((9, 13), np.float32)
    weight[4, 4] = weight[0, 12] = 1
    filled = pull_push_fill(values, weight)
    np.testing.assert_allclose(filled[4, 4], 7)
    assert 3 <= filled.min() <= filled.max() <= 7
    np.testing.assert_allclose(pull_push_fill(np.full((9, 13, 2), 3.0, np.float32), weight), 3, rtol=1e-6)
