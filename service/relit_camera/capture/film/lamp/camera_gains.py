"""What the camera's automatics did to each frame: one gain a channel, seen in what the flash does not reach.

A phone sets exposure and white balance anew for every frame, so a dark frame taken from a bright one leaves a blue or
an orange face (thesis 4.3.5). The wall far behind the person gets the same light all the time: how its picture changes
is what the automatics did.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_SIDE = 96
"""Cells along the longer side of the pictures in which gains are looked for."""
_FLOOR = 1e-4
_VISIBLE, _CLIPPED = 0.015, 0.85
"""Of a cell's mean and of its most: darker ones are noise, brighter ones the end of the code values."""
_LEAST, _ALIKE = 5.0, 0.06
"""Cells that follow the flash by no more than this (logarithm) over the least following ones (percentile) count as not
reached by it."""
_REACHED_TOO = 0.3
"""If even those follow it by this share of what the most reached ones do, it reaches everything."""
_FEWEST = 0.02
"""Share of all cells that must be unreached."""
_STEADY = 2.5
"""Cells that fit the common gains so many times worse than usual are left out: something moves there."""
_MOST_LEFT = 0.5


@dataclass(frozen=True, eq=False)
class FrameGains:
    """The automatics' gains.

    Attributes:
        rgb: (frames, 3) each frame's, by channel; the geometric mean over the bright ones is 1.
        spread: how far the cells of one frame differ about its gain (robust standard deviation of logarithms, median
            over the frames): near the noise's where one gain a channel is all that was done.
        share: of all cells that tell them; 0 where hardly any does.
        visible: share of all cells that show the room, neither too dark nor too bright, without the flash: where it is
            not small but `share` is 0, the flash reaches everything.
        left_as_is, left: share of the room's light that is left, either sign, where a frame without the flash is taken
            from one with it, with the gains as they were and made equal.
    """

    rgb: Floats
    spread: float
    share: float
    visible: float
    left_as_is: float
    left: float

    @property
    def too_dim(self) -> bool:
        """Whether the room shows too little, so that it is not the flash that keeps it from telling."""
        return not self.share and self.visible < _FEWEST

    @property
    def source(self) -> str:
        """Where they are from, for people."""
        return "what the flash does not reach" if self.share else "dark frames, and time between them"

    @property
    def can_subtract_room(self) -> bool:
        """Whether taking the room's light off leaves less than half of it."""
        return self.left < _MOST_LEFT


def downsample_for_gains(frame: LinearImage) -> NDArray[np.float16]:
    """A frame, linear RGB (height, width, 3), in 96 cells along its longer side."""
    height, width = frame.shape[:2]
    scale = min(1.0, _SIDE / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), np.float16)


def estimate_gains(
    cells: NDArray[np.float16], times_s: Floats, bright: NDArray[np.bool_], flash: NDArray[np.intp]
) -> FrameGains:
    """The gains of bright and dark frames.

    Where the flash reaches everything that is seen, dark frames alone tell theirs, and the bright ones' are
    interpolated by time.

    Args:
        cells: (frames, rows, columns, 3) of `downsample_for_gains`, bright and dark frames in their order.
        times_s: (frames,) growing.
        bright: (frames,) which are bright; there are dark ones too.
        flash: (frames,) number of each one's flash.
    """
    frames, rows, columns, _ = cells.shape
    flat = cells.reshape(frames, rows * columns, 3)
    least, most = flat.min(axis=2).min(axis=0), flat.max(axis=2).max(axis=0)
    visible = (np.median(flat, axis=0).mean(axis=1) > _VISIBLE) & (least > 0) & (most < _CLIPPED)
    of_room = np.median(flat[~bright], axis=0).mean(axis=1) > _VISIBLE
    unreached = _unreached(flat, times_s, bright, flash, visible)
    share = float(unreached.mean())
    if share >= _FEWEST:
        telling = flat[:, unreached]
        logs, spread = _common(telling)
    else:
        share, telling = 0.0, flat[:, visible]
        logs, spread = _by_time(telling, times_s, bright)
    logs -= logs[bright].mean(axis=0)
    gains = np.exp(logs)
    judged = np.flatnonzero(bright if share else ~bright)
    left_as_is, left = (_left(telling, each, judged, np.flatnonzero(~bright)) for each in (np.ones_like(gains), gains))
    return FrameGains(gains, spread, share, float((visible & of_room).mean()), left_as_is, left)


def _unreached(
    flat: NDArray[np.float16], times_s: Floats, bright: NDArray[np.bool_], flash: NDArray[np.intp], visible: NDArray
) -> NDArray[np.bool_]:
    """Cells (cells,) that change least with the flash."""
    light = np.log(flat.astype(np.float32).mean(axis=2) + np.float32(_FLOOR))
    dark_s, dark = times_s[~bright], light[~bright]
    steps = []
    for number in np.unique(flash[bright]):
        lit = bright & (flash == number)
        before = int(np.clip(np.searchsorted(dark_s, times_s[lit].mean()), 1, max(1, len(dark_s) - 1)))
        around = dark[before - 1 : before + 1]
        steps.append(light[lit].mean(axis=0) - around.mean(axis=0))
    follows = np.median(steps, axis=0)
    if not visible.any():
        return visible
    low, high = np.percentile(follows[visible], [_LEAST, 95])
    if low > _REACHED_TOO * high and low > _ALIKE:
        return np.zeros_like(visible)
    return np.asarray(visible & (follows < low + _ALIKE))


def _common(cells: NDArray[np.float16]) -> tuple[Floats, float]:
    """Logarithms of the gains (frames, 3) that cells (frames, cells, 3) have in common, and how far they differ."""
    logs = np.log(cells.astype(np.float32) + np.float32(_FLOOR))
    logs -= logs.mean(axis=0)
    gains = np.median(logs, axis=1)
    left = np.abs(logs - gains[:, None]).mean(axis=(0, 2))
    steady = left <= _STEADY * np.median(left)
    logs = logs[:, steady]
    gains = np.median(logs, axis=1)
    spread = 1.4826 * float(np.median(np.median(np.abs(logs - gains[:, None]), axis=1)))
    return gains.astype(np.float64), spread


def _by_time(cells: NDArray[np.float16], times_s: Floats, bright: NDArray[np.bool_]) -> tuple[Floats, float]:
    """The same of the dark frames, in which all cells are unreached; of the bright ones between them by time."""
    if cells.shape[1] == 0:
        return np.zeros((len(times_s), 3)), 0.0
    known, spread = _common(cells[~bright])
    logs = np.stack([np.interp(times_s, times_s[~bright], channel) for channel in known.T], axis=1)
    return logs, spread


def _left(cells: NDArray[np.float16], gains: Floats, judged: Indices, dark: Indices) -> float:
    """Share of the room's light in cells (frames, cells, 3) left if the nearest dark frame's is taken off (median)."""
    if cells.shape[1] == 0:
        return 1.0
    shares = []
    for index in judged:
        others = dark[dark != index]
        other = others[np.abs(others - index).argmin()]
        light, room = (cells[each].astype(np.float32) / gains[each] for each in (index, other))
        shares.append(np.median(np.abs(light - room).sum(axis=1) / np.maximum(room.sum(axis=1), _FLOOR)))
    return float(np.median(shares))
