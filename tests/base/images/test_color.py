"""Colour curves against the published sRGB values, colour temperatures against published chromaticities."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relit_camera.base.errors import InputError
from relit_camera.base.images.color import (
    LUMINANCE,
    decode,
    linear_from_uint8,
    luminance,
    parse_gamma,
    rgb_from_hex,
    rgb_from_kelvin,
    srgb_decode,
    srgb_encode,
    uint8_from_linear,
)

CODES = np.arange(256, dtype=np.uint8)


@pytest.mark.parametrize(
    ("code", "linear"),
    # IEC 61966-2-1 evaluated by hand: the linear segment below 10.3, mid grey, and the ends.
    [(0, 0.0), (1, 1 / 255 / 12.92), (10, 10 / 255 / 12.92), (11, 0.003346536), (128, 0.215860501), (188, 0.502886458),
     (255, 1.0)],
)  # fmt: skip
def test_published_values(code: int, linear: float) -> None:
    assert float(srgb_decode(code / 255)) == pytest.approx(linear, rel=2e-5)
    assert float(linear_from_uint8(np.array([code], np.uint8))[0]) == pytest.approx(linear, rel=2e-5)
    assert float(srgb_encode(linear)) * 255 == pytest.approx(code, abs=2e-3)


def test_every_code_survives_the_round_trip() -> None:
    np.testing.assert_array_equal(uint8_from_linear(linear_from_uint8(CODES)), CODES)


@given(st.floats(0, 1, width=32))
def test_curves_are_inverse(value: float) -> None:
    assert float(srgb_decode(srgb_encode(value))) == pytest.approx(value, abs=2e-6)


@given(st.floats(-2, 3, width=32))
def test_the_table_agrees_with_the_curve(value: float) -> None:
    exact = float(srgb_encode(value)) * 255
    assert abs(float(uint8_from_linear(np.array([value], np.float32))[0]) - exact) <= 0.75


def test_what_no_display_can_show_is_clipped() -> None:
    odd = np.array([-1, 2, np.nan, np.inf, -np.inf], np.float32)
    np.testing.assert_array_equal(uint8_from_linear(odd), [0, 255, 0, 255, 0])


def test_decode_under_each_gamma() -> None:
    half = np.array([0.5], np.float32)
    assert decode(half, "linear") == pytest.approx(0.5)
    assert decode(half, "srgb") == pytest.approx(0.21404114, rel=1e-5)
    assert decode(half, 2.2) == pytest.approx(0.5**2.2, rel=1e-6)
    assert decode(half, 2.2).dtype == np.float32


@pytest.mark.parametrize(("text", "gamma"), [("srgb", "srgb"), ("linear", "linear"), ("2.2", 2.2), ("1", 1.0)])
def test_gamma_is_read(text: str, gamma: str | float) -> None:
    assert parse_gamma(text) == gamma


@pytest.mark.parametrize("text", ["", "SRGB", "0", "-2.2", "9", "nan", "inf", "2,2"])
def test_wrong_gamma_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="unknown gamma"):
        parse_gamma(text)


def test_luminance_of_white_and_the_primaries() -> None:
    assert LUMINANCE.sum() == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(luminance(np.eye(3, dtype=np.float32)), (0.2126, 0.7152, 0.0722))


XYZ_FROM_RGB = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


@pytest.mark.parametrize(
    ("kelvin", "xy"),
    # CIE standard illuminants A, D50, D55, D65, D75; the black body at 3000 K is from Wyszecki and Stiles.
    [(2856, (0.44757, 0.40745)), (3000, (0.43693, 0.40407)), (5003, (0.34567, 0.35850)), (5503, (0.33242, 0.34743)),
     (6504, (0.31271, 0.32902)), (7504, (0.29902, 0.31485))],
)  # fmt: skip
def test_published_chromaticities(kelvin: float, xy: tuple[float, float]) -> None:
    xyz = XYZ_FROM_RGB @ rgb_from_kelvin(kelvin)
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), xy, atol=1.2e-3)


@given(st.floats(1667, 25000))
def test_a_colour_temperature_has_luminance_one(kelvin: float) -> None:
    rgb = rgb_from_kelvin(kelvin)
    assert float(rgb @ LUMINANCE) == pytest.approx(1, abs=1e-5)
    assert (rgb >= 0).all()


def test_daylight_is_white_candles_are_red_and_the_sky_is_blue() -> None:
    np.testing.assert_allclose(rgb_from_kelvin(6504), 1, atol=0.01)
    red, _, blue = rgb_from_kelvin(1900)
    assert red > 2 * blue
    red, _, blue = rgb_from_kelvin(15000)
    assert blue > 1.3 * red


def test_a_colour_temperature_has_no_steps() -> None:
    colours = np.array([rgb_from_kelvin(kelvin) for kelvin in range(1700, 12000, 10)])
    assert np.abs(np.diff(colours, axis=0)).max() < 0.015


def test_redness_falls_with_temperature() -> None:
    ratios = [rgb[0] / rgb[2] for rgb in map(rgb_from_kelvin, range(2200, 25000, 200))]
    # The two loci meet at 4000 K with a small step; everywhere else the ratio falls strictly.
    assert (np.diff(ratios) < 0).all()


def test_temperatures_outside_the_fit_are_clamped() -> None:
    np.testing.assert_array_equal(rgb_from_kelvin(500), rgb_from_kelvin(1667))
    np.testing.assert_array_equal(rgb_from_kelvin(1e6), rgb_from_kelvin(25000))


def test_a_hex_color_is_three_codes() -> None:
    assert rgb_from_hex("#ff8001") == (255, 128, 1)


@pytest.mark.parametrize("code", ["", "ff8001", "#ff80", "#ff80012", "#gg8001"])
def test_anything_else_is_no_hex_color(code: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        rgb_from_hex(code)
