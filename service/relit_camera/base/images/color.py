"""Color conversions and the color of light. Linear values are Rec. 709 RGB, scene-referred, channels in that order."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import DisplayImage

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
"""Rec. 709 luminance weights of linear R, G, B."""

CHROMA_MATRIX = np.array(
    [[-37.797, -74.203, 112.0, 128 * 255], [112.0, -93.786, -18.214, 128 * 255], [0, 0, 0, 0]], dtype=np.float32
) / np.float32(255)
"""U, V and 0 of R, G, B from 0 to 255 (ITU-R BT.601, limited range). The third row is for `cv2.transform`, which takes
a tenth of the time for three channels of three."""

Gamma = str | float
"""Transfer curve of a picture's code values: "srgb", "linear", or the exponent of a power law."""


def srgb_decode(encoded: ArrayLike) -> NDArray[np.float32]:
    """Linear light of sRGB code values in 0..1 (IEC 61966-2-1), float32, same shape."""
    value = np.asarray(encoded, dtype=np.float32)
    return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0) + 0.055) / 1.055) ** 2.4).astype(np.float32)


def srgb_encode(linear: ArrayLike) -> NDArray[np.float32]:
    """SRGB code values of linear light (IEC 61966-2-1), float32, same shape, clipped to 0..1."""
    value = np.clip(np.asarray(linear, dtype=np.float32), 0.0, 1.0)
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * value ** (1 / 2.4) - 0.055).astype(np.float32)


WIDE_TABLES = int(cv2.__version__.split(".")[0]) >= 5
"""Whether `cv2.LUT` takes 16-bit indices, which it does three times as fast as numpy."""


@lru_cache(maxsize=1)
def _encode_table() -> NDArray[np.uint8]:
    return np.round(srgb_encode(np.linspace(0, 1, 1 << 16)) * 255).astype(np.uint8)


@lru_cache(maxsize=1)
def _decode_table() -> NDArray[np.float32]:
    return srgb_decode(np.arange(256, dtype=np.float32) / 255)


def uint8_from_linear(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """SRGB uint8 picture of linear light, same shape; values outside 0..1 are clipped, NaN becomes 0."""
    if not linear.size:
        return np.zeros(linear.shape, np.uint8)
    # OpenCV rounds, makes 0 of what is negative and of NaN, and of what no integer can hold too: so that is cut first.
    index = cv2.multiply(np.minimum(linear, 1).reshape(1, -1), 65535, dtype=cv2.CV_16U)
    coded = cv2.LUT(index, _encode_table()) if WIDE_TABLES else _encode_table().take(index)
    return np.asarray(coded, np.uint8).reshape(linear.shape)


def linear_from_uint8(encoded: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear light, float32, of an sRGB uint8 picture of any shape."""
    # cv2.LUT is ten times as fast as indexing; it wants two or three dimensions.
    if encoded.ndim in (2, 3) and encoded.size:
        return np.asarray(cv2.LUT(encoded, _decode_table()), dtype=np.float32)
    return _decode_table()[encoded]


def parse_gamma(text: str) -> Gamma:
    """Parse the name of a transfer curve: `srgb`, `linear`, or an exponent between 0.2 and 5.

    Raises:
        InputError: anything else.
    """
    if text in ("srgb", "linear"):
        return text
    try:
        exponent = float(text)
    except ValueError:
        exponent = np.nan
    if not 0.2 <= exponent <= 5:
        raise InputError(f"unknown gamma '{text}'", "use srgb, linear, or a number from 0.2 to 5")
    return exponent


def decode(encoded: NDArray[np.float32], gamma: Gamma) -> NDArray[np.float32]:
    """Linear light of code values in 0..1 under `gamma`, float32, same shape."""
    if gamma == "linear":
        return encoded.astype(np.float32)
    if gamma == "srgb":
        return srgb_decode(encoded)
    return np.power(np.maximum(encoded, 0), float(gamma)).astype(np.float32)


def encode(linear: NDArray[np.float32], gamma: Gamma) -> NDArray[np.float32]:
    """Code values of linear light in 0..1 under `gamma`, float32, same shape: the inverse of `decode`."""
    if gamma == "linear":
        return linear.astype(np.float32)
    if gamma == "srgb":
        return srgb_encode(linear)
    return np.power(np.maximum(linear, 0), 1 / float(gamma)).astype(np.float32)


def luminance(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rec. 709 luminance (...,) of linear RGB (..., 3)."""
    result: NDArray[np.float32] = linear @ LUMINANCE
    return result


def rgb_from_hex(code: str) -> tuple[int, int, int]:
    """The three 8-bit sRGB codes of a color written as `#rrggbb`.

    Raises:
        ValueError: `code` is not of that form.
    """
    if len(code) != 7 or code[0] != "#":
        raise ValueError(f"'{code}' is no color; write it as #rrggbb")
    red, green, blue = bytes.fromhex(code[1:])
    return red, green, blue


def _planckian_locus(t: float) -> NDArray[np.float64]:
    """CIE x and y of a black body at 1667 to 25000 K, after Kim et al. 2002."""
    if t < 4000:
        x = -0.2661239e9 / t**3 - 0.2343589e6 / t**2 + 0.8776956e3 / t + 0.179910
    else:
        x = -3.0258469e9 / t**3 + 2.1070379e6 / t**2 + 0.2226347e3 / t + 0.240390
    if t < 2222:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif t < 4000:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    return np.array([x, y])


def _daylight_locus(t: float) -> NDArray[np.float64]:
    """CIE x and y of daylight at 4000 to 25000 K."""
    if t <= 7000:
        x = -4.6070e9 / t**3 + 2.9678e6 / t**2 + 0.09911e3 / t + 0.244063
    else:
        x = -2.0064e9 / t**3 + 1.9018e6 / t**2 + 0.24748e3 / t + 0.237040
    return np.array([x, -3.0 * x**2 + 2.870 * x - 0.275])


def rgb_from_kelvin(kelvin: float) -> NDArray[np.float32]:
    """Linear RGB (3,) of a black body or daylight at `kelvin`, scaled to luminance 1; negative parts are cut.

    Chromaticity: black body below 4000 K, CIE daylight above 5000 K, between them a mixture of both; clamped to
    1667 to 25000 K.
    """
    t = float(np.clip(kelvin, 1667, 25000))
    daylight = float(np.clip((t - 4000) / 1000, 0, 1))
    x, y = (1 - daylight) * _planckian_locus(t) + daylight * _daylight_locus(max(t, 4000))
    xyz = np.array([x / y, 1.0, (1 - x - y) / y])
    rgb_from_xyz = np.array(
        [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
    )
    rgb = np.maximum(rgb_from_xyz @ xyz, 0).astype(np.float32)
    return np.asarray(rgb / (rgb @ LUMINANCE), dtype=np.float32)


def rgb_to_i420(image: DisplayImage, onto: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
    """Convert uint8 sRGB RGB (height, width, 3), both even, to uint8 (height · width · 3/2,): planes Y, U, V.

    With `onto`, uint8 (height · 3/2, width), they are written there.

    Chroma is the mean of each two by two pixels: OpenCV's own conversion takes that of every second pixel, which frays
    edges.
    """
    height, width = image.shape[:2]
    planes: NDArray[np.uint8] = cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420, onto).reshape(-1)
    half = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    chroma = cv2.transform(half, CHROMA_MATRIX)
    for channel, plane in enumerate(planes[height * width :].reshape(2, height // 2, width // 2)):
        cv2.extractChannel(chroma, channel, plane)
    return planes
