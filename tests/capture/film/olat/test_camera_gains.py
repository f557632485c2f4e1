"""Gains of a camera that hunts, from pictures whose gains were put in."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.olat.camera_gains import (
    FrameGains,
    downsample_for_gains,
    estimate_gains,
    require_uniform_gains,
)


def scene(*, reached: bool, uneven: float = 0.0, seed: int = 0) -> tuple[FrameGains, np.ndarray, np.ndarray]:
    """Gains found, those put in (frames, 3), and which frames are bright."""
    rng = np.random.default_rng(seed)
    frames, rows, columns = 60, 24, 18
    index = np.arange(frames)
    bright = index % 6 < 3
    wall = rng.uniform(0.05, 0.3, (rows, columns, 3))
    person = np.zeros((rows, columns, 1))
    person[8:, 5:13] = 1
    # The automatics answer the flash too.
    swing = 0.3 * np.sin(index / 5) - 0.2 * bright
    gains = np.exp(swing[:, None] * [1.0, 0.8, 0.6])
    flash = bright[:, None, None, None] * (person * 0.5 + (1 - person) * (0.15 if reached else 0.0))
    light = (wall * 0.5 + flash * (1 + 0.3 * np.sin(index / 9))[:, None, None, None]) * gains[:, None, None, :]
    if uneven:
        place = rng.normal(0, uneven, (frames, rows, columns, 1))
        light = light * np.exp(place)
    light = light + rng.normal(0, 0.001, light.shape)
    cells = np.maximum(light, 0).astype(np.float16)
    return estimate_gains(cells, index / 30, bright, index // 6), gains, bright


def test_gains_are_measured_on_the_wall() -> None:
    found, gains, bright = scene(reached=False)
    expected = gains / np.exp(np.log(gains[bright]).mean(axis=0))
    np.testing.assert_allclose(found.rgb, expected, rtol=0.01)
    assert found.fraction > 0.4
    assert found.left < 0.03 < 0.15 < found.left_as_is
    assert found.can_subtract_room


def test_where_the_flash_reaches_everything_gains_are_measured_in_dark_frames() -> None:
    found, gains, bright = scene(reached=True)
    assert found.fraction == 0
    assert not found.too_dim
    assert "dark frames" in found.source
    error = np.log(found.rgb[~bright]) - np.log(gains[~bright])
    assert (error - error.mean(axis=0)).std() < 0.02


def test_local_changes_raise_the_spread() -> None:
    plain, enhanced = scene(reached=False)[0], scene(reached=False, uneven=0.2)[0]
    assert plain.spread < 0.03
    assert enhanced.spread == pytest.approx(0.2, rel=0.25)


def test_cells_keep_the_mean_and_the_shape() -> None:
    picture = np.random.default_rng(0).uniform(0, 1, (480, 320, 3)).astype(np.float32)
    cells = downsample_for_gains(picture)
    assert cells.shape == (96, 64, 3)
    np.testing.assert_allclose(cells.mean(axis=(0, 1), dtype=float), picture.mean(axis=(0, 1)), rtol=2e-3)


def before_a_wall(wall: tuple[float, float, float]) -> FrameGains:
    """Gains of a person whom the flash lights, and a wall with that light."""
    rng = np.random.default_rng(0)
    index = np.arange(60)
    bright = index % 6 < 3
    light = np.ones((60, 24, 18, 3)) * wall * (1 + 0.02 * rng.normal(size=(60, 24, 18, 1)))
    light[:, 8:, 5:13] += 0.1 + 0.3 * bright[:, None, None, None]
    return estimate_gains(light.astype(np.float16), index / 30, bright, index // 6)


def test_gains_are_measured_on_a_wall_in_warm_light_with_little_blue() -> None:
    found = before_a_wall((0.04, 0.025, 0.013))
    assert found.fraction > 0.3
    assert not found.too_dim


def test_a_dark_room_is_not_taken_for_one_that_the_flash_reaches() -> None:
    rng = np.random.default_rng(0)
    index = np.arange(60)
    light = np.full((60, 24, 18, 3), 0.004) * rng.uniform(0.9, 1.1, (60, 24, 18, 1))
    light[index % 6 < 3, 8:, 5:13] += 0.3
    found = estimate_gains(light.astype(np.float16), index / 30, index % 6 < 3, index // 6)
    assert found.fraction == 0
    assert found.too_dim


def test_a_camera_that_improves_pictures_is_refused() -> None:
    require_uniform_gains(0.03)
    with pytest.raises(CaptureError, match=r"changes parts of the picture by themselves, by 20%.*turn off HDR"):
        require_uniform_gains(0.2)
