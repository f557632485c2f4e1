"""The matte against the painted one."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.capture.film.olat.flash_matte import estimate_flash_matte


def painted(wall_reached: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """One-light pictures, the room's, the true alpha, and where dark hair is."""
    rng = np.random.default_rng(seed)
    side = 120
    x, y = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    alpha = np.clip(30 - np.hypot(x - 60, y - 55) + 0.5, 0, 1)
    alpha = np.maximum(alpha, np.clip(45 - np.hypot(x - 60, y - 130) + 0.5, 0, 1))
    hair = (y < 42) & (alpha == 1)
    reflectance = np.where(hair, 0.03, 0.5)
    wall = 0.3 + 0.3 * (x > 80)
    room = 0.08 * (alpha * reflectance + (1 - alpha) * wall)
    pictures = []
    for angle in np.linspace(-1.2, 1.2, 12):
        # From each side a part of the person is in the dark.
        lit = np.clip(0.6 + np.sin(angle) * (x - 60) / 30, 0, 1)
        light = alpha * reflectance * lit + (1 - alpha) * wall * wall_reached
        pictures.append(light[..., None] + rng.normal(0, 0.001, (side, side, 3)))
    return np.stack(pictures).astype(np.float32), np.repeat(room[..., None], 3, 2).astype(np.float32), alpha, hair


@pytest.mark.parametrize("wall_reached", [0.0, 0.03])
def test_the_person_is_found_dark_hair_too(wall_reached: float) -> None:
    pictures, room, alpha, hair = painted(wall_reached)
    matte = estimate_flash_matte(pictures, room)
    assert matte.dtype == np.float32
    assert np.abs(matte - alpha).mean() < 0.012
    assert matte[cv2.erode(hair.astype(np.uint8), np.ones((5, 5))) > 0].min() > 0.9
    assert matte[:15, :15].max() == 0


def test_excluded_places_are_transparent() -> None:
    pictures, room, _, _ = painted(0.0)
    nobody = np.zeros(room.shape[:2], bool)
    nobody[:, :60] = True
    assert estimate_flash_matte(pictures, room, nobody)[:, :55].max() == 0


def test_without_flash_most_is_transparent() -> None:
    noise = np.random.default_rng(0).normal(0, 0.001, (8, 40, 40, 3)).astype(np.float32)
    matte = estimate_flash_matte(noise, np.full((40, 40, 3), 0.1, np.float32))
    assert matte.mean() < 0.35
