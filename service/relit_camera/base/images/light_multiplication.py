"""Multiplying the light of an sRGB picture, pixel by pixel, without making linear light of it.

Above its toe sRGB is the 2.4th root of light, scaled and shifted. The root of a product is the product of the roots,
and roots need 16 bits where light would need floats. So two tables, toe and display curve included, and one product of
16-bit numbers do what decoding, multiplying and coding would.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import WIDE_TABLES, linear_from_uint8, srgb_encode
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.tone_mapping import linear_from_display, tone_curve

_CODES = np.arange(256, dtype=np.uint8)
_ONE = 1 << 14
"""What stands for a root of 1 in 16 bits. The largest, a light of 27, reads 255; a code is 60 steps wide."""
POWER = 2.4
"""Of the root of light in which pictures are multiplied."""
_BAND_CELLS = 32
"""Rows of cells that are multiplied at a time: their 16-bit numbers stay in the processor's cache."""


def root_of_light(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """The 2.4th root of non-negative light or factors of light, float32 of the same shape (up to four channels)."""
    return np.asarray(cv2.pow(light, 1 / POWER), np.float32)


def light_of_root(root: NDArray[np.float32]) -> NDArray[np.float32]:
    """The inverse of `root_of_light`."""
    return np.asarray(cv2.pow(root, POWER), np.float32)


def multiply_light(
    image: DisplayImage,
    roots: NDArray[np.float32],
    step: int,
    as_shown: float = 0.0,
    added: NDArray[np.float32] | None = None,
) -> DisplayImage:
    """A picture with its light multiplied, as the display shows it: uint8 sRGB of the same shape.

    Args:
        image: uint8 sRGB (height, width, 3).
        roots: (⌈height / step⌉, ⌈width / step⌉, 3) float32, the roots of the factors in the middles of cells of `step`
            by `step` pixels; between them they are interpolated.
        step: the side of a cell in pixels.
        as_shown: how far the picture's brightest codes are taken for the light that the display curve would show so: 0
            takes them for just what sRGB says, 1 gives back the picture itself where the factor is 1.
        added: roots of the shape of `roots` that are added after that; none if None.
    """
    height, width = image.shape[:2]
    cells = _bordered_codes(roots)
    more = None if added is None or not added.any() else _bordered_codes(added)
    columns = step * cells.shape[1]
    image, shown = np.ascontiguousarray(image), np.empty(image.shape, np.uint8)
    fine = np.empty((step * (_BAND_CELLS + 2), columns, 3), np.uint16)
    for first in range(0, len(cells) - 2, _BAND_CELLS):
        some = cells[first : first + _BAND_CELLS + 2]
        above = cv2.resize(some, (columns, step * len(some)), fine[: step * len(some)], interpolation=cv2.INTER_LINEAR)
        top, bottom = step * first, min(step * (first + _BAND_CELLS), height)
        product = _roots_of(image[top:bottom], as_shown)
        inner = np.s_[step : step + bottom - top, :width]
        cv2.multiply(product, above[inner], dst=product, scale=1 / _ONE)
        if more is not None:
            _add(product, more[first : first + _BAND_CELLS + 2], step, fine)
        if WIDE_TABLES:
            cv2.LUT(product, _codes_of_roots(), dst=shown[top:bottom])
        else:
            _codes_of_roots().take(product, out=shown[top:bottom], mode="clip")  # other modes would copy `out`
    return shown


def _add(product: NDArray[np.uint16], cells: NDArray[np.uint16], step: int, buffer: NDArray[np.uint16]) -> None:
    """Add roots in cells, the first and last row of them beyond the picture, where there are any.

    `buffer` is overwritten; it has room for the cells in pixels.
    """
    some = np.flatnonzero(cells.max(axis=0).any(axis=1))
    if some.size == 0:
        return
    # With one more column on each side, between which the roots come down to 0.
    first, last = max(int(some[0]) - 1, 0), min(int(some[-1]) + 2, cells.shape[1])
    size = (step * (last - first), step * len(cells))
    fine = buffer[: size[1], : size[0]]
    cv2.resize(cells[:, first:last], size, fine, interpolation=cv2.INTER_LINEAR)
    onto = product[:, step * first : step * last]
    cv2.add(onto, fine[step : step + onto.shape[0], : onto.shape[1]], dst=onto)


def _bordered_codes(roots: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Roots in 16 bits, with the first and last row repeated."""
    codes = cv2.multiply(roots, (_ONE,) * 4, dtype=cv2.CV_16U)
    return np.asarray(cv2.copyMakeBorder(codes, 1, 1, 0, 0, cv2.BORDER_REPLICATE), np.uint16)


def _roots_of(image: DisplayImage, as_shown: float) -> NDArray[np.uint16]:
    """The roots of the light of a picture's codes, uint16 of its shape."""
    if not WIDE_TABLES or image.size % 2:
        return np.asarray(cv2.LUT(image, _roots_of_codes(as_shown)), np.uint16)
    pairs = cv2.LUT(image.reshape(1, -1).view(np.uint16), _roots_of_pairs(as_shown))
    return np.asarray(pairs, np.int32).view(np.uint16).reshape(image.shape)


@lru_cache(maxsize=4)
def _roots_of_pairs(as_shown: float) -> NDArray[np.int32]:
    """The roots of two neighboring codes at once, which takes half as many look-ups: (65536,)."""
    codes = np.arange(1 << 16, dtype=np.uint16).view(np.uint8)
    return _roots_of_codes(as_shown)[codes].view(np.int32)


@lru_cache(maxsize=64)
def _roots_of_codes(as_shown: float) -> NDArray[np.uint16]:
    light = (1 - as_shown) * linear_from_uint8(_CODES) + as_shown * linear_from_display(_CODES[None])[0]
    return np.asarray(np.round(_ONE * light ** (1 / POWER)), np.uint16)


@lru_cache(maxsize=1)
def _codes_of_roots() -> NDArray[np.uint8]:
    light = (np.arange(1 << 16) / _ONE) ** POWER
    return np.round(255 * srgb_encode(tone_curve(light))).astype(np.uint8)
