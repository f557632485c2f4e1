"""Removing noise from a live picture where it stands still, by averaging it over time.

Where two frames differ no more than by noise, the shown picture is a moving average; elsewhere it is the frame as it
is. What moves differs in two ways: more than noise does, and alike over several pixels, which noise does not. The
second tells motions of a fraction of a pixel, and light that changes.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage

Box = tuple[int, int, int, int]
"""Left, top, right and bottom, in pixels."""


@dataclass(frozen=True)
class TemporalNoiseTunables:
    """Constants, chosen on four films of people with noise of 1.5 and 3 codes added; differences are of green codes.

    Attributes:
        step: every so many pixels of a row and a column are compared.
        window: so many of these on a side are looked at together.
        alike: what the mean difference of a window is multiplied by before it is compared with the mean absolute one.
        calmest: share of the windows that are taken to show nothing but noise.
        remembered: frames whose least noise counts: in one that moves as a whole there is more.
        least: mean absolute difference below which there is nothing to remove.
        still, moving: differences of a window, in units of the noise, up to which it is averaged and from which not.
        weight: of a frame in the average.
    """

    step: int = 3
    window: int = 5
    alike: float = 3.0
    calmest: float = 0.1
    remembered: int = 30
    least: float = 0.7
    still: float = 1.6
    moving: float = 2.4
    weight: float = 1 / 3


TUNABLES = TemporalNoiseTunables()


class TemporalNoiseFilter:
    """Removes noise from one frame after another."""

    def __init__(self) -> None:
        """Begin without a frame."""
        self._last: DisplayImage | None = None
        self._noise: deque[float] = deque(maxlen=TUNABLES.remembered)

    def filtered(self, image: DisplayImage, box: Box) -> DisplayImage:
        """The next frame (height, width, 3) uint8 with less noise in a box; the frame itself where nothing is removed.

        Neither it nor the result may be written to afterwards.
        """
        tuning = TUNABLES
        last, self._last = self._last, image
        if last is None or last.shape != image.shape:
            self._noise.clear()
            return image
        left, top, right, bottom = box
        inside = np.s_[top:bottom, left:right]
        sampled = np.s_[top : bottom : tuning.step, left : right : tuning.step, 1]
        green, before = np.ascontiguousarray(image[sampled]), np.ascontiguousarray(last[sampled])
        if min(green.shape) < tuning.window:
            return image
        window = (tuning.window, tuning.window)
        apart = cv2.subtract(green, before, dtype=cv2.CV_32F)
        size, shift = cv2.blur(cv2.absdiff(apart, 0.0), window), cv2.blur(apart, window)
        some = size[tuning.window // 2 :: tuning.window, tuning.window // 2 :: tuning.window].ravel()
        rank = int(tuning.calmest * len(some))
        self._noise.append(float(np.partition(some, rank)[rank]))
        noise = min(self._noise)
        if noise < tuning.least:
            return image
        difference = cv2.max(size, cv2.multiply(cv2.absdiff(shift, 0.0), tuning.alike))
        slope = 255 / (noise * (tuning.moving - tuning.still))
        share = cv2.addWeighted(difference, -slope, difference, 0, slope * tuning.moving * noise, dtype=cv2.CV_8U)
        # A share of the pixels is averaged in place of a share of each pixel, which would take four times as long.
        share = cv2.resize(share, (right - left, bottom - top), interpolation=cv2.INTER_LINEAR)
        chosen = cv2.compare(share, _thresholds(*share.shape), cv2.CMP_GT)
        average = cv2.addWeighted(image[inside], tuning.weight, last[inside], 1 - tuning.weight, 0)
        result = image.copy()
        cv2.copyTo(average, chosen, result[inside])
        self._last = result
        return result


@lru_cache(maxsize=4)
def _thresholds(height: int, width: int) -> NDArray[np.uint8]:
    """Thresholds (height, width), 8 to 248 in steps of 16, neighbors far apart: ordered dithering (Bayer, 1973)."""
    order = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
    tiled = np.tile((16 * order + 8).astype(np.uint8), (-(-height // 4), -(-width // 4)))
    return np.ascontiguousarray(tiled[:height, :width])
