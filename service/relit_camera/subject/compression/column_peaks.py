"""The peaks of a field under each texel of the light map and each captured light: errors are relative to these."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_quality import PEAK_PERCENT
from relit_camera.subject.compression.field_tiles import TILE_WIDTH
from relit_camera.subject.reflectance_field import ReflectanceField

Values = NDArray[np.float32]

SAMPLE_LINES, SAMPLE_PIXELS = 32, 4096
"""Lines of the picture, and pixels of these, at most, from which the texels' peaks are estimated."""


def light_peaks(captured: Values, inside: NDArray[np.bool_], pool: ThreadPoolExecutor) -> Values:
    """The peaks (lights,) of captured pictures (lights, height, width, 3) among the pixels `inside` (pixels,)."""
    pictures = captured.reshape(len(captured), -1, 3)
    return np.array(list(pool.map(lambda each: np.percentile(each[inside], PEAK_PERCENT), pictures)), np.float32)


def texel_peaks(field: ReflectanceField, inside: NDArray[np.bool_], pool: ThreadPoolExecutor) -> Values:
    """Estimates (2048,) of the peaks under each texel alone, from lines spread over the picture.

    Lines cross everything that is bright. A sample of clusters misses the bright spots of some texels: their allowed
    error is then too small, and as one threshold serves all columns, everything becomes larger.
    """
    width = field.size[0]
    pixels = np.flatnonzero(inside)
    lines = np.split(pixels, np.flatnonzero(np.diff(pixels // width)) + 1)
    lines = lines[:: -(-len(lines) // SAMPLE_LINES)]
    step = -(-sum(map(len, lines)) // SAMPLE_PIXELS)

    def read(line: NDArray[np.intp]) -> Values:
        some = line[::step]
        parts = np.split(some, np.flatnonzero(np.diff(some % width // TILE_WIDTH)) + 1)
        return np.concatenate([field.dense(int(part[0]), int(part[-1]) + 1)[part - part[0]] for part in parts])

    rows = list(pool.map(read, lines))
    # Where few pixels are bright, as under a light from behind, chance decides how many of them a sample has, and with
    # too high a peak a texel gets too large an error: of three estimates the lowest counts.
    thirds = [np.concatenate(rows[first::3]) for first in range(min(len(rows), 3))]
    peaks = [np.percentile(third, PEAK_PERCENT, axis=(0, 2)) for third in thirds]
    return np.asarray(np.min(peaks, axis=0), np.float32)
