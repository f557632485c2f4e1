"""When the light goes on and off, from frame to frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

Floats = NDArray[np.float64]

_WEAKEST = 0.04
"""Changes of level below this share of the usual one are no flash."""


@dataclass(frozen=True, eq=False)
class Edges:
    """The moments at which the light goes on and off, in turns.

    Attributes:
        times_s: (edges,) growing, on the clock of the frames' first exposed row.
        rising: (edges,) whether it goes on.
        frame: (edges,) index of the last frame before the middle of the change.
    """

    times_s: Floats
    rising: NDArray[np.bool_]
    frame: NDArray[np.intp]

    def only(self, some: slice) -> Edges:
        """Some of them."""
        return Edges(self.times_s[some], self.rising[some], self.frame[some])


def find_edges(level: Floats, times_s: Floats, frequency_hz: float) -> Edges:
    """Where the level crosses the middle between its local extremes; between frames by interpolation."""
    interval = float(np.median(np.diff(times_s)))
    window = max(3, round(1.1 / frequency_hz / interval))
    low, high = minimum_filter1d(level, window), maximum_filter1d(level, window)
    middle, height = (low + high) / 2, high - low
    above = level > middle
    frame = np.flatnonzero(above[1:] != above[:-1])
    frame = frame[height[frame] > _WEAKEST * np.percentile(height, 90)]
    rising = above[frame + 1]
    # In turns: a fall that was too weak to count leaves two rises in a row.
    kept = np.ones(len(frame), bool)
    kept[:-1] &= ~(rising[:-1] & rising[1:])
    kept[1:] &= ~(~rising[1:] & ~rising[:-1])
    frame, rising = frame[kept], rising[kept]
    # Where the level stands, it is the middle that moves past it.
    step = level[frame + 1] - level[frame]
    share = np.divide(middle[frame] - level[frame], step, out=np.full(len(frame), 0.5), where=step != 0)
    return Edges(times_s[frame] + np.clip(share, 0, 1) * (times_s[frame + 1] - times_s[frame]), rising, frame)
