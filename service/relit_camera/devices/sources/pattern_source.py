"""A moving test pattern. Every picture carries its number, which can be read from the pixels after any codec."""

from __future__ import annotations

import itertools
from functools import lru_cache

import numpy as np

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sources.playback_source import PlaybackSource
from relit_camera.devices.sources.source import Source, SourceInfo

NUMBER_BITS = 24
NUMBER_CELLS = 32
"""Black and white cells along the top edge: the number, highest bit first, and eight check bits."""

STRIP_FRACTION = 12
"""The cells are a twelfth of the picture high."""

COLOR_BARS = np.array(
    [[191, 191, 191], [191, 191, 0], [0, 191, 191], [0, 191, 0], [191, 0, 191], [191, 0, 0], [0, 0, 191], [16, 16, 16]],
    dtype=np.uint8,
)
"""The colors of a television test picture at 75 %."""


def pattern_source(size: tuple[int, int], fps: float) -> Source:
    """A source that draws the test pattern `fps` times a second, for ever.

    Raises:
        InputError: narrower than 128 or lower than 96 pixels: the number could not be read back.
    """
    if size[0] < 128 or size[1] < 96:
        raise InputError(f"the test pattern cannot be {size[0]}x{size[1]}", "use at least 128x96")
    pictures = ((draw_pattern(size, number), number / fps) for number in itertools.count())
    return PlaybackSource(SourceInfo("pattern", "pattern", size, fps), pictures)


def draw_pattern(size: tuple[int, int], number: int) -> DisplayImage:
    """Picture `number` of the pattern, uint8 sRGB (height, width, 3): bars that move left, over a grey ramp."""
    bars = _draw_bars(size)
    height, width = bars.shape[:2]
    shift = number * max(1, width // 320) % width
    image = np.concatenate([bars[:, shift:], bars[:, :shift]], axis=1)
    number %= 1 << NUMBER_BITS
    word = number << (NUMBER_CELLS - NUMBER_BITS) | check_bits(number)
    bits = [word >> (NUMBER_CELLS - 1 - cell) & 1 for cell in range(NUMBER_CELLS)]
    strip = np.where(bits, 255, 0).astype(np.uint8)[np.arange(width) * NUMBER_CELLS // width]
    image[: height // STRIP_FRACTION] = strip[None, :, None]
    return image


@lru_cache(maxsize=1)
def _draw_bars(size: tuple[int, int]) -> DisplayImage:
    width, height = size
    bars = np.repeat(COLOR_BARS[np.arange(width) * len(COLOR_BARS) // width][None], height, axis=0)
    ramp = np.linspace(0, 255, width).astype(np.uint8)
    bars[height * 5 // 6 :] = ramp[None, :, None]
    return bars


def check_bits(number: int) -> int:
    """The eight check bits of a number."""
    # 0xA5: so neither a black nor a white strip is a number.
    return (number ^ number >> 8 ^ number >> 16) & 0xFF ^ 0xA5
