"""Depth by integration: smooth surfaces exactly, steps kept, perspective."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.geometry import normal_integration as module
from relit_camera.capture.geometry.normal_integration import integrate_normals


def normals_of(surface: NDArray[np.float64]) -> NDArray[np.float32]:
    """Unit normals of a depth map (height, width) in pixels."""
    down, right = np.gradient(surface)
    normals = np.dstack([-right, down, np.ones_like(surface)])
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)


def grid(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns and rows from the middle, y up."""
    x, y = np.meshgrid(np.arange(size) - size / 2 + 0.5, size / 2 - 0.5 - np.arange(size))
    return x, y


def test_a_hill_comes_back() -> None:
    x, y = grid(60)
    hill = 20 * np.exp(-(x**2 + 2 * y**2) / 400)
    inside = x**2 + y**2 < 28**2
    found = integrate_normals(normals_of(hill), inside)
    assert np.isnan(found[~inside]).all()
    error = found[inside] - hill[inside]
    assert (error - error.mean()).std() < 0.1
    assert found[inside].mean() == pytest.approx(0, abs=1e-4)


def test_a_crease_stays_sharp() -> None:
    x, _ = grid(40)
    roof = -np.abs(x) * 1.5
    normals = np.zeros((40, 40, 3), np.float32)
    normals[..., 0], normals[..., 2] = 1.5 * np.sign(x), 1
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    found = integrate_normals(normals, np.ones((40, 40), bool))
    np.testing.assert_allclose(found, roof - roof.mean(), atol=0.8)


def test_a_ball_before_a_wall_keeps_its_shape(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it ends is a step that no normal tells; a plain Poisson equation bends the ball to join the wall."""
    x, y = grid(64)
    ball = x**2 + y**2 < 17.7**2
    truth = np.sqrt(np.maximum(18**2 - x**2 - y**2, 0))
    normals = np.dstack([x / 18, y / 18, truth / 18])
    normals[~ball] = (0, 0, 1)
    errors = {}
    for rounds in (1, 50):
        monkeypatch.setattr(module, "TUNABLES", module.IntegrationTunables(rounds=rounds))
        error = (integrate_normals(normals.astype(np.float32), np.ones(ball.shape, bool)) - truth)[ball]
        errors[rounds] = error.std()
    assert errors[50] < 0.25
    assert errors[50] < 0.7 * errors[1]


def test_perspective_is_taken_out() -> None:
    """A ball of 8 cm, 40 cm before the camera, whose focal length is 200 px: a pixel spans a millimetre or so."""
    size, focal, distance, radius = 100, 200.0, 40.0, 8.0
    x, y = grid(size)
    rays = np.dstack([x / focal, y / focal, -np.ones_like(x)])
    # |t·ray − (0, 0, −distance)|² = radius², the nearer solution.
    a, b = (rays**2).sum(axis=2), -distance * np.ones_like(x)
    inner = b * b - a * (distance**2 - radius**2)
    inside = inner > 0.15 * inner.max()
    t = (-b - np.sqrt(np.maximum(inner, 0))) / a
    points = rays * t[..., None]
    normals = ((points + np.array([0, 0, distance])) / radius).astype(np.float32)
    truth = points[..., 2][inside]
    errors = {}
    for focal_px in (focal, None):
        found = integrate_normals(normals, inside, focal_px=focal_px)[inside]
        scaled = (truth - truth.mean()) * focal / -truth.mean()
        errors[focal_px] = np.sqrt(np.mean((found - scaled) ** 2))
    assert errors[focal] < 0.35
    assert errors[None] > 3 * errors[focal]


def test_what_is_not_trusted_does_not_count() -> None:
    x, y = grid(40)
    hill = 10 * np.exp(-(x**2 + y**2) / 150)
    normals, trust = normals_of(hill), np.ones((40, 40), np.float32)
    normals[10:14, 10:14] = (0.9, 0, 0.436)
    trust[10:14, 10:14] = 0.01
    found = integrate_normals(normals, np.ones((40, 40), bool), trust)
    outside = trust == 1
    error = (found - hill)[outside]
    assert (error - error.mean()).std() < 0.15
