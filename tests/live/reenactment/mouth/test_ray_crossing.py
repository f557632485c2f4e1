"""Rays and round bodies: the first of two crossings, none beside the body, and a soft outline."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.live.reenactment.mouth.ray_crossing import EDGE_ON, first_crossing, share_at_outline

AWAY = np.array([0, 0, -1], np.float32)


def test_the_first_crossing_with_a_sphere_is_on_it_and_faces_the_camera() -> None:
    x = np.linspace(-0.99, 0.99, 21, dtype=np.float32)
    start = np.stack([x, 0 * x, 0 * x + 5])
    steps, met = first_crossing(start, AWAY)
    points = start + steps * AWAY[:, None]
    assert met.all()
    np.testing.assert_allclose(np.linalg.norm(points, axis=0), 1, atol=1e-4)
    assert (points[2] > 0).all()


def test_beside_the_sphere_nothing_is_met() -> None:
    start = np.array([[1.01, -3.0], [0, 0], [5, 5]], np.float32)
    assert not first_crossing(start, AWAY)[1].any()


def test_a_body_fills_its_pixels_but_at_the_outline() -> None:
    cosines = np.array([1.0, 2 * EDGE_ON, EDGE_ON / 2, 0.0, -0.5], np.float32)
    normals = 3 * np.stack([np.sqrt(1 - cosines**2), 0 * cosines, cosines])
    assert share_at_outline(normals, AWAY) == pytest.approx([1, 1, 0.5, 0, 0], abs=1e-4)
