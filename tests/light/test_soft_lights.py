"""Soft lights: even, fixed in the room, and fitted as the problem says."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, fibonacci_directions, texel_directions
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.light.soft_lights import SoftLights, regularized_nnls


def test_together_they_are_even_light() -> None:
    total = SoftLights().maps().sum(axis=1)
    assert total.std() < 0.02 * total.mean()


def test_each_is_half_as_bright_twenty_degrees_away() -> None:
    lights = SoftLights()
    cosines = texel_directions().reshape(-1, 3) @ fibonacci_directions(lights.count)[11]
    about = np.abs(np.degrees(np.arccos(cosines)) - 20) < 1.5
    assert about.sum() > 10
    np.testing.assert_allclose(lights.maps()[about, 11], 0.48, atol=0.06)


def test_under_a_turned_head_they_are_the_turned_lights() -> None:
    turn = rotation_from_angles(30, -10, 5)
    fixed = SoftLights().maps()[:, 33].reshape(MAP_HEIGHT, MAP_WIDTH, 1).repeat(3, axis=2)
    expected = rotate_light_map(fixed, turn)[..., 0].ravel()
    np.testing.assert_allclose(SoftLights().maps(turn)[:, 33], expected, atol=0.05)


def test_the_fit_is_non_negative_least_squares_with_a_ridge() -> None:
    """Against scipy's nnls on the stacked system, which is the same problem."""
    rng = np.random.default_rng(4)
    design, prior = rng.random((200, 12)), rng.random(12)
    truth = np.maximum(rng.normal(0.3, 0.5, 12), 0)
    values = (design @ truth + rng.normal(0, 0.05, 200)).astype(np.float32)
    weight = rng.random(200)
    ridge = 3e-3 * np.trace(design.T @ (design * weight[:, None])) / 12
    stacked = np.vstack([design * np.sqrt(weight)[:, None], np.sqrt(ridge) * np.eye(12)])
    expected, _ = nnls(stacked, np.concatenate([values * np.sqrt(weight), np.sqrt(ridge) * prior]))
    np.testing.assert_allclose(regularized_nnls(design, values, weight, prior, 3e-3), expected, atol=1e-6)
