"""Removing noise from a live picture where it stands still, by averaging it over time.

Where a frame differs from what was shown before no more than by noise, a moving average is shown; elsewhere the frame
as it is. What moves differs in two ways: more than noise does, and alike over several pixels, which noise does not. The
second tells slow motion and light that changes. Noise that is alike over several pixels itself, as cameras that remove
noise leave it, is not removed.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Box, DisplayImage


@dataclass(frozen=True)
class TemporalNoiseTunables:
    """Constants, chosen on four films of people with white noise of 1.5 and 3 codes added.

    Differences are those of a channel of pictures at half their size, in codes; a window's is a mean.

    Attributes:
        window: so many of their pixels on a side are looked at together.
        black, white: codes between which a window tells the noise; beyond them it is cut.
        windows: so many of them must tell it.
        calmest: share of them that is taken to show nothing but noise.
        remembered: measurements of which the least counts: in a frame that moves as a whole there is more.
        asked_every: while nothing is removed, noise is measured in one of so many frames.
        least, most: noise from one frame to the next, of the channel that has least: with less there is nothing to
            remove, and more is no noise.
        still, moving: differences of a window, in units of the noise, up to which it is averaged and from which not.
        weight: of a frame in the average.
    """

    window: int = 5
    black: int = 12
    white: int = 240
    windows: int = 12
    calmest: float = 0.1
    remembered: int = 45
    asked_every: int = 4
    least: float = 0.65
    most: float = 4.0
    still: float = 2.3
    moving: float = 3.5
    weight: float = 1 / 3


TUNABLES = TemporalNoiseTunables()
_SCALE, _ZERO = 4.0, 128
"""Differences are kept in 8 bits, as quarters of a code about the middle: larger ones need not be told apart."""


class TemporalNoiseFilter:
    """Removes noise from one frame after another."""

    def __init__(self) -> None:
        """Begin without a frame."""
        self._live: DisplayImage | None = None
        self._shown: DisplayImage | None = None
        self._half: tuple[Box, DisplayImage] | None = None
        self._noise: deque[NDArray[np.float32]] = deque(maxlen=TUNABLES.remembered)
        self._frames = 0

    def filtered(self, image: DisplayImage, box: Box) -> DisplayImage:
        """The next frame (height, width, 3) uint8 with less noise in a box; the frame itself where nothing is removed.

        Neither it nor the result may be written to afterwards.
        """
        live, shown = self._live, self._shown
        if live is None or shown is None or shown.shape != image.shape:
            self._noise.clear()
            self._half, result = None, image
        else:
            result = self._averaged(image, live, shown, box)
        self._live, self._shown = image, result
        self._frames += 1
        return result

    def _averaged(self, image: DisplayImage, live: DisplayImage, shown: DisplayImage, box: Box) -> DisplayImage:
        """The frame, averaged with what was `shown` before, when the frame was `live`."""
        tuning, inside = TUNABLES, np.s_[box[1] : box[3], box[0] : box[2]]
        part, before = image[inside], shown[inside]
        quiet = shown is live and self._frames % tuning.asked_every != 0
        if quiet or min(part.shape[:2]) < 2 * tuning.window:
            self._half = None
            return image
        last = self._half[1] if self._half is not None and self._half[0] == box else _half_size(live[inside])
        self._half = box, _half_size(part)
        if np.array_equal(self._half[1], last):
            if shown is live:
                return image
            # The webcam repeats its frame: what was shown of it is still the best there is.
            average, chosen = before, np.full(part.shape[:2], 255, np.uint8)
        else:
            noise = self._measured_noise(self._half[1], last)
            if noise is None:
                return image
            share = _still_share(_difference(self._half[1], _half_size(before)), noise)
            share = cv2.resize(share, (part.shape[1], part.shape[0]), interpolation=cv2.INTER_LINEAR)
            # A share of the pixels is averaged in place of a share of each, which would take four times as long.
            chosen = cv2.compare(share, _thresholds(*image.shape[:2], self._frames % 4)[inside], cv2.CMP_GT)
            average = cv2.addWeighted(part, tuning.weight, before, 1 - tuning.weight, 0)
        result = image.copy()
        cv2.copyTo(average, chosen, result[inside])
        return result

    def _measured_noise(self, image: DisplayImage, last: DisplayImage) -> NDArray[np.float32] | None:
        """What noise alone lets a frame differ by from what was shown before, (3,) codes; None if nothing is removed.

        Both pictures (rows, columns, 3) are at half the size of the frames, this one and the last.
        """
        tuning = TUNABLES
        middles = np.s_[tuning.window // 2 :: tuning.window, tuning.window // 2 :: tuning.window]
        size, code = _mean_size(_difference(image, last))[middles], image[middles]
        size = size[((code > tuning.black) & (code < tuning.white)).all(axis=2)]
        if len(size) < tuning.windows:
            return None
        rank = int(tuning.calmest * len(size))
        self._noise.append(np.partition(size, rank, axis=0)[rank] / np.float32(_SCALE))
        noise = np.min(self._noise, axis=0)
        if not tuning.least <= noise.min() <= tuning.most:
            return None
        # Of two frames both have noise; of what was shown only w / (2 - w) of its variance is left.
        return np.asarray(noise * np.sqrt(1 / (2 - tuning.weight)), np.float32)


def _half_size(image: DisplayImage) -> DisplayImage:
    """The picture at half its size: each pixel is the mean of four, a last odd row or column left out."""
    rows, columns = (side // 2 for side in image.shape[:2])
    even = image[: 2 * rows, : 2 * columns]
    return np.asarray(cv2.resize(even, (columns, rows), interpolation=cv2.INTER_LINEAR), np.uint8)


def _difference(image: DisplayImage, other: DisplayImage) -> NDArray[np.uint8]:
    """How much one picture exceeds another in each channel: see `_SCALE`."""
    return np.asarray(cv2.addWeighted(image, _SCALE, other, -_SCALE, _ZERO), np.uint8)


def _mean_size(apart: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Mean absolute difference of the window round each pixel, in units of `_SCALE`; of the shape of `apart`."""
    return np.asarray(cv2.blur(cv2.absdiff(apart, (_ZERO,) * 4), (TUNABLES.window,) * 2), np.uint8)


def _still_share(apart: NDArray[np.uint8], noise: NDArray[np.float32]) -> NDArray[np.uint8]:
    """How far pixels stand still, (rows, columns) from 0 to 255, by differences in three channels and their noise.

    Differences that are alike all over a window count twice: the mean of 25 differences by noise is a fifth of one.
    """
    tuning = TUNABLES
    shift = cv2.absdiff(cv2.blur(apart, (tuning.window,) * 2), (_ZERO,) * 4)
    difference = cv2.max(_mean_size(apart), cv2.add(shift, shift))
    slopes = 255 / (_SCALE * noise * (tuning.moving - tuning.still))
    shares = [
        cv2.addWeighted(each, -slope, each, 0, 255 * tuning.moving / (tuning.moving - tuning.still))
        for each, slope in zip(cv2.split(difference), slopes.tolist(), strict=True)
    ]
    return np.asarray(cv2.min(cv2.min(shares[0], shares[1]), shares[2]), np.uint8)


@lru_cache(maxsize=4)
def _thresholds(height: int, width: int, turn: int) -> NDArray[np.uint8]:
    """Thresholds (height, width), 8 to 248 in steps of 16, neighbors far apart: ordered dithering (Bayer, 1973).

    Moved by `turn`, 0 to 3, so that no pixel is always below those next to it.
    """
    order = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
    order = np.roll(order, (turn // 2, turn), (0, 1))
    tiled = np.tile((16 * order + 8).astype(np.uint8), (-(-height // 4), -(-width // 4)))
    return np.ascontiguousarray(tiled[:height, :width])
