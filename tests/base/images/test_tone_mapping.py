from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relit_camera.base.errors import ImageError
from relit_camera.base.images.color import linear_from_uint8, srgb_encode
from relit_camera.base.images.tone_mapping import (
    SHOULDER,
    display_from_linear,
    inverse_tone_curve,
    linear_from_display,
    tone_curve,
)


def grey_ramp(light: np.ndarray) -> np.ndarray:
    return np.repeat(light.astype(np.float32)[None, :, None], 3, axis=2)


def test_the_curve_is_the_scene_below_the_shoulder_and_reaches_one_only_at_infinity() -> None:
    below = np.linspace(0, SHOULDER, 50)
    np.testing.assert_allclose(tone_curve(below), below, rtol=1e-6)
    np.testing.assert_allclose(tone_curve([1, 2]), [0.9, 1 - 0.04 / 1.4], rtol=1e-6)
    assert tone_curve(1e9) == pytest.approx(1)
    assert tone_curve(-3) == 0


def test_value_and_slope_are_continuous_at_the_shoulder() -> None:
    step = 1e-3
    around = tone_curve(np.array([SHOULDER - step, SHOULDER, SHOULDER + step])).astype(float)
    np.testing.assert_allclose(np.diff(around) / step, 1, atol=0.01)


@given(st.floats(0, 1e6), st.floats(0, 1e6))
def test_brighter_light_never_shows_darker(a: float, b: float) -> None:
    low, high = sorted((a, b))
    assert tone_curve(low) <= tone_curve(high) <= 1


def test_the_table_is_the_curve_within_rounding() -> None:
    ramp = grey_ramp(np.linspace(0, 20, 200_001))
    exact = srgb_encode(tone_curve(ramp)) * 255
    assert np.abs(display_from_linear(ramp) - exact).max() < 0.6


def test_a_white_ball_at_the_shoulder_reads_what_srgb_says() -> None:
    assert display_from_linear(grey_ramp(np.array([0.8])))[0, 0, 0] == round(float(srgb_encode(0.8)) * 255)


def test_light_that_is_no_light_is_black_and_endless_light_white() -> None:
    picture = np.array([[[np.nan, -1, 0], [np.inf, 1e30, 1e4], [-np.inf, 16, 40]]], dtype=np.float32)
    np.testing.assert_array_equal(display_from_linear(picture), [[[0, 0, 0], [255, 255, 255], [0, 255, 255]]])


@pytest.mark.parametrize("shape", [(1, 1, 3), (31, 7, 3), (32, 5, 3), (101, 3, 3)])
def test_every_row_is_done_whatever_the_height(shape: tuple[int, int, int]) -> None:
    picture = np.random.default_rng(1).random(shape, dtype=np.float32)
    shown = display_from_linear(picture)
    np.testing.assert_allclose(shown, srgb_encode(tone_curve(picture)) * 255, atol=0.6)


def test_a_view_into_a_larger_picture_is_shown_as_its_copy() -> None:
    picture = np.random.default_rng(2).random((40, 60, 3), dtype=np.float32)
    np.testing.assert_array_equal(display_from_linear(picture[5:30, 7:50]), display_from_linear(picture)[5:30, 7:50])


def test_a_picture_comes_back_from_its_light_but_for_the_last_codes() -> None:
    codes = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    back = display_from_linear(linear_from_display(codes))
    np.testing.assert_array_equal(back, np.minimum(codes, 252))


def test_the_inverse_undoes_the_curve() -> None:
    light = np.linspace(0, 2, 300)
    np.testing.assert_allclose(inverse_tone_curve(tone_curve(light)), light, rtol=2e-4)
    assert inverse_tone_curve(1.0) == pytest.approx(2, rel=1e-4)


def test_linear_from_display_agrees_with_the_srgb_curve_below_the_shoulder() -> None:
    codes = np.arange(231, dtype=np.uint8).reshape(1, -1, 1).repeat(3, axis=2)
    np.testing.assert_allclose(linear_from_display(codes), linear_from_uint8(codes), rtol=1e-6)


@pytest.mark.parametrize("picture", [np.zeros((4, 4), np.float32), np.zeros((4, 4, 3), np.float64)])
def test_another_shape_or_dtype_is_refused(picture: np.ndarray) -> None:
    with pytest.raises(ImageError, match="linear picture has shape"):
        display_from_linear(picture)
