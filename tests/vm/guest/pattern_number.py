"""Reads the number that each picture of the test pattern carries, wherever the picture arrives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.devices.sources.pattern_source import NUMBER_BITS, NUMBER_CELLS, STRIP_FRACTION, check_bits


def read_number(image: NDArray[np.uint8]) -> int | None:
    """The number in a picture of the pattern, uint8 (height, width, 3); None if the check bits do not fit."""
    height, width = image.shape[:2]
    centers = (np.arange(NUMBER_CELLS) + 0.5) * width / NUMBER_CELLS
    half = max(1, width // (NUMBER_CELLS * 4))
    rows = image[height // (STRIP_FRACTION * 4) : max(1, 3 * height // (STRIP_FRACTION * 4))]
    means = [rows[:, int(center) - half : int(center) + half].mean() for center in centers]
    word = int("".join("1" if mean > 127 else "0" for mean in means), 2)
    number, check = word >> (NUMBER_CELLS - NUMBER_BITS), word & 0xFF
    return number if check == check_bits(number) else None
