"""Frames that the schedule calls bright or dark, and that their light speaks against."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.flash.brightness import Brightness
from relit_camera.capture.flash.lit_shares import Blocks
from relit_camera.capture.flash.signal import Signal

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

WEAKEST = 0.4
"""A flash that adds less than this share of the usual light points elsewhere or comes from too far."""

_UNLIT, _STRAY = 0.75, 0.1
"""A block of a bright frame with less of its neighbours' light than this, or a dark one's with more, is unlike them."""
_FAINT = 0.3
"""Blocks that the flash reaches by less than this share of the usual are not asked."""
_STRENGTH_PERCENTILE = 98
"""Of the light that a flash adds to the cells: what faces it, wherever it comes from."""


def unlike_neighbours(blocks: Blocks, bright: Indices, dark: Indices) -> dict[int, str]:
    """Frames of which some block is not lit as in the frames of their kind before and after, and the reason to give.

    Args:
        blocks: brightness of blocks of the picture.
        bright: growing indices of frames to judge.
        dark: the same.
    """
    if len(bright) < 3 or len(dark) < 3:
        return {}
    lit, unlit = blocks.between(bright), blocks.between(dark)
    height = np.maximum(lit - unlit, 1e-9)
    clear = height > _FAINT * np.median(height[bright])
    expected = np.maximum(_from_neighbours(blocks.level[bright], bright) - unlit[bright], 1e-9)
    missing = ((blocks.level[bright] - unlit[bright]) / expected < _UNLIT) & clear[bright]
    stray = (blocks.level[dark] - _from_neighbours(blocks.level[dark], dark)) / height[dark] > _STRAY
    doubtful = [(bright[missing.any(axis=1)], "bright"), (dark[(stray & clear[dark]).any(axis=1)], "dark")]
    return {int(index): f"not lit like the {kind} frames beside it" for found, kind in doubtful for index in found}


def strengths(seen: Brightness, signal: Signal, bright: Indices, dark: Indices, flash: Indices) -> Floats:
    """Light that each flash adds, relative to the median: (flashes,), NaN where it has no bright frame.

    Args:
        seen: the video.
        signal: its gains, and which cells the flash reaches.
        bright: growing indices of bright frames.
        dark: of dark ones.
        flash: (frames,) number of each frame's flash.
    """
    added = np.full(int(flash.max()) + 1, np.nan)
    if not len(bright) or not len(dark):
        return added
    steady = seen.cells[:, signal.reached] / signal.gains[:, None]
    for each in np.unique(flash[bright]):
        lit = bright[flash[bright] == each]
        near = int(np.clip(np.searchsorted(dark, lit[0]) - 2, 0, max(0, len(dark) - 4)))
        without = steady[dark[near : near + 4]].mean(axis=0)
        added[each] = np.percentile(steady[lit].mean(axis=0) - without, _STRENGTH_PERCENTILE)
    return np.asarray(added / np.nanmedian(added))


def _from_neighbours(level: Floats, index: Indices) -> Floats:
    """Levels (count, blocks) interpolated from those before and after, by index; at the ends their own."""
    way = ((index[1:-1] - index[:-2]) / (index[2:] - index[:-2]))[:, None]
    inner = level[:-2] * (1 - way) + level[2:] * way
    return np.concatenate([level[:1], inner, level[-1:]])
