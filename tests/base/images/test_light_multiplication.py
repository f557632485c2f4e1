"""Light multiplied in 16 bits, against decoding, multiplying and coding in floats."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images import light_multiplication
from relit_camera.base.images.color import WIDE_TABLES, linear_from_uint8
from relit_camera.base.images.light_multiplication import light_of_root, multiply_light, root_of_light
from relit_camera.base.images.tone_mapping import display_from_linear

STEP = 4
CODES = np.arange(256, dtype=np.uint8).reshape(16, 16)[..., None].repeat(3, axis=2)


def roots(factor: np.ndarray) -> np.ndarray:
    return root_of_light(np.asarray(factor, np.float32))


def even(factor: float) -> np.ndarray:
    return roots(np.full((4, 4, 3), factor))


@pytest.mark.parametrize("factor", [0.02, 0.1, 0.5, 0.9, 1.0, 1.5, 4.0, 12.0])
def test_every_code_is_as_in_floats(factor: float) -> None:
    expected = display_from_linear(linear_from_uint8(CODES) * np.float32(factor))
    error = np.abs(multiply_light(CODES, even(factor), STEP).astype(int) - expected)
    assert error.max() <= 1
    assert (error > 0).mean() < 0.05


def test_a_picture_taken_for_what_is_shown_stays_where_the_factor_is_one() -> None:
    np.testing.assert_array_equal(multiply_light(CODES, even(1.0), STEP, as_shown=1), np.minimum(CODES, 252))


def test_factors_belong_to_the_middles_of_cells_and_each_channel_has_its_own() -> None:
    """A ramp of roots, linear over the picture, is the same ramp at every pixel; the last cells reach beyond it."""
    height, width = 22, 30
    x = (np.arange(8) + 0.5) * STEP
    ramp = np.broadcast_to((0.5 + x / 40)[None, :, None] * [1, 0.8, 0.6], (6, 8, 3)).astype(np.float32)
    picture = multiply_light(np.full((height, width, 3), 100, np.uint8), ramp, STEP)
    assert picture.shape == (height, width, 3)
    at = (0.5 + (np.arange(width) + 0.5) / 40)[:, None] * np.array([1, 0.8, 0.6])
    light = linear_from_uint8(np.full((1, 1), 100, np.uint8)) * light_of_root(at.astype(np.float32))
    expected = display_from_linear(np.asarray(light[None], np.float32))[0].astype(int)
    assert np.abs(picture[10, 2:-2].astype(int) - expected[2:-2]).max() <= 1


def test_numpy_looks_up_the_same_where_opencv_cannot(monkeypatch: pytest.MonkeyPatch) -> None:
    image = np.random.default_rng(0).integers(0, 256, (32, 32, 3)).astype(np.uint8)
    factors = roots(np.random.default_rng(1).random((8, 8, 3)) * 3)
    pictures = []
    for wide in (False, WIDE_TABLES):
        monkeypatch.setattr(light_multiplication, "WIDE_TABLES", wide)
        pictures.append(multiply_light(image, factors, STEP))
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert pictures[0].dtype == np.uint8


@pytest.mark.parametrize("shape", [(300, 40), (301, 41), (129, 3)])
def test_a_tall_picture_is_multiplied_in_bands_without_seams(shape: tuple[int, int]) -> None:
    """A ramp of roots down the picture, against the same ramp in floats: no row is displaced, none left out."""
    height, width = shape
    image = np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)
    y = (np.arange(-(-height // STEP)) + 0.5) * STEP
    ramp = np.broadcast_to((0.4 + y / 400)[:, None, None], (len(y), -(-width // STEP), 3)).astype(np.float32)
    at = np.clip(np.arange(height) + 0.5, y[0], y[-1])
    light = linear_from_uint8(image) * light_of_root((0.4 + at / 400).astype(np.float32)).reshape(-1, 1, 1)
    error = np.abs(multiply_light(image, ramp, STEP).astype(int) - display_from_linear(light.astype(np.float32)))
    assert error.max() <= 1
    assert (error > 0).mean() < 0.05
