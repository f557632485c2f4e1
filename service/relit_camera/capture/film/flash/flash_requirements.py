"""Videos that no flashes can be told from, and what to do differently."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.flash.flash_schedule import FlashEdges, FlashFrequency

Floats = NDArray[np.float64]

MIN_FLASHES = 8
MIN_BRIGHT_FRAMES = 8

_LEAST_BEAT = 0.2
"""Share of the variance that a flash explains at least."""
_LEAST_CONTRAST = 1.15
"""Ratio of bright to dark that a flash has at least."""
_LEAST_STEP = 0.25
"""Share of the whole change that comes from one frame to the next, of a flash that is no slow wave."""
_SLOW_PERIOD = 8
"""Frames a period from which that can be asked for."""
_FEW_WHOLE = 0.4
"""Share of the flashes that light a whole frame, below which they are too fast."""
_CHANGING = 1.5
"""Ratio of brightness over a video in which a light was on."""


def require_blinking(level: Floats, interval_s: float, beat: FlashFrequency, edges: FlashEdges) -> None:
    """Nothing, if the level (frames,) goes up and down as a blinking light's does.

    Raises:
        CaptureError: it does not; the light is on all the time, or there is none.
    """
    window = max(3, round(1.1 / beat.frequency_hz / interval_s))
    low, high = minimum_filter1d(level, window), maximum_filter1d(level, window)
    contrast = float(np.median(high / np.maximum(low, 1e-6)))
    step = np.abs(level[edges.frame + 1] - level[edges.frame]) / np.maximum((high - low)[edges.frame], 1e-9)
    slow = 1 / beat.frequency_hz / interval_s >= _SLOW_PERIOD
    blinks = beat.share >= _LEAST_BEAT and contrast >= _LEAST_CONTRAST and len(step) > 0
    if not blinks or (slow and np.median(step) < _LEAST_STEP):
        ratio = float(np.percentile(level, 98) / max(np.percentile(level, 2), 1e-6))
        if ratio > _CHANGING:
            what = f"no flash found: the brightness changes by a factor of {ratio:.1f}, but nothing blinks"
            raise CaptureError(what, "the light must not be on all the time: let it blink, about five times a second")
        what = f"no flash found: the brightness stays within {ratio - 1:.0%}"
        raise CaptureError(what, "let a light blink about five times a second, a metre away, in a dim room")
    flashes = int(edges.rising.sum())
    if flashes < MIN_FLASHES:
        raise CaptureError(f"only {flashes} flashes found", "record half a minute or more of the blinking light")


def require_fully_lit_frames(frequency_hz: float, interval_s: float, whole: float) -> None:
    """Nothing, if enough flashes light a frame as a whole.

    Args:
        frequency_hz: of the flashes.
        interval_s: from frame to frame.
        whole: share of the flashes that do.

    Raises:
        CaptureError: too few do.
    """
    if whole < _FEW_WHOLE:
        rate = 1 / interval_s
        what = f"the light blinks {frequency_hz:.1f} times a second, too fast for {rate:.0f} frames a second"
        cure = f"let it blink at most {rate / 6:.0f} times a second, or make the room a little brighter"
        raise CaptureError(f"{what}: {whole:.0%} of the flashes light a whole frame", cure)


def require_bright_frames(bright: int) -> None:
    """Nothing, if there are enough bright frames.

    Raises:
        CaptureError: there are not.
    """
    if bright < MIN_BRIGHT_FRAMES:
        cure = "record half a minute or more, the light about a metre away and pointing at the face"
        raise CaptureError(f"the flash lights only {bright} frames wholly and strongly enough", cure)
