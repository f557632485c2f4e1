"""Frames that the schedule calls bright or dark, and that their light speaks against."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.flash.exposure_fractions import BrightnessBlocks
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid, FlashSignal

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

MIN_FLASH_STRENGTH = 0.4
"""A flash that adds less than this share of the usual light points elsewhere or comes from too far."""

_UNLIT, _UNLIT_ALONE, _STRAY = 0.75, 0.5, 0.1
"""A block of a bright frame with less of its neighbours' light than this, or of a dark one with more, is unlike them:
by what the whole frame has, since automatics may change from frame to frame. Between two flashes the light moves on,
and a frame that is alone in its flash may differ more."""
_ALONE = 2
"""Frames to the nearest bright one beyond which it belongs to another flash."""
_FAINT = 0.3
"""Blocks that the flash reaches by less than this share of the usual are not asked."""
_STRENGTH_PERCENTILE = 98
"""Of the light that a flash adds to the cells: what faces it, wherever it comes from."""


def find_outlier_frames(blocks: BrightnessBlocks, bright: Indices, dark: Indices) -> dict[int, str]:
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
    shares = ((blocks.level - unlit) / height)[bright]
    gap = np.diff(bright, prepend=-_ALONE - 1, append=2 * bright[-1])
    least = np.where(np.minimum(gap[:-1], gap[1:]) > _ALONE, _UNLIT_ALONE, _UNLIT)
    missing = (shares < np.median(shares, axis=1, keepdims=True) * least[:, None]) & clear[bright]
    usual = np.median(blocks.level / np.maximum(unlit, 1e-9), axis=1, keepdims=True)
    stray = ((blocks.level - usual * unlit) / height > _STRAY)[dark]
    doubtful = [(bright[missing.any(axis=1)], "bright"), (dark[(stray & clear[dark]).any(axis=1)], "dark")]
    return {int(index): f"not lit like the {kind} frames beside it" for found, kind in doubtful for index in found}


def relative_flash_strengths(
    brightness: BrightnessGrid, signal: FlashSignal, bright: Indices, dark: Indices, flash: Indices
) -> Floats:
    """Light that each flash adds, relative to the median: (flashes,), NaN where it has no bright frame.

    Args:
        brightness: the video.
        signal: its gains, and which cells the flash reaches.
        bright: growing indices of bright frames.
        dark: of dark ones.
        flash: (frames,) number of each frame's flash.
    """
    added = np.full(int(flash.max()) + 1, np.nan)
    if not len(bright) or not len(dark):
        return added
    steady = brightness.cells[:, signal.reached] / signal.gains[:, None]
    for each in np.unique(flash[bright]):
        lit = bright[flash[bright] == each]
        near = int(np.clip(np.searchsorted(dark, lit[0]) - 2, 0, max(0, len(dark) - 4)))
        without = steady[dark[near : near + 4]].mean(axis=0)
        added[each] = np.percentile(steady[lit].mean(axis=0) - without, _STRENGTH_PERCENTILE)
    return np.asarray(added / np.nanmedian(added))
