"""The kinds of frames.

Bright, dark, partial or rejected: what each frame of a video is good for.

Bright and dark frames by the recipe of thesis 4.3.2, for comparison: it wants 30 frames a second and 5 flashes.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.exposure_fractions import BrightnessBlocks
from relit_camera.capture.film.flash.flash_requirements import (
    require_blinking,
    require_bright_frames,
    require_fully_lit_frames,
)
from relit_camera.capture.film.flash.flash_schedule import (
    FULLY_LIT_FRACTION,
    FlashSchedule,
    RollingShutter,
    find_flash_edges,
    find_flash_frequency,
    schedule_from_edges,
)
from relit_camera.capture.film.flash.flash_signal import (
    BrightnessGrid,
    FlashSignal,
    extract_flash_signal,
    mean_level,
    reached_cells,
)
from relit_camera.capture.film.flash.frame_outliers import (
    MIN_FLASH_STRENGTH,
    find_outlier_frames,
    relative_flash_strengths,
)
from relit_camera.capture.film.flash.rolling_shutter import fit_rolling_shutter


class FrameClass(StrEnum):
    """What a frame is, as a capture's report names it."""

    BRIGHT = "bright"
    """The flash lit it wholly."""
    DARK = "dark"
    """The flash lit none of it."""
    PARTIAL = "partial"
    """The flash lit some rows, or all for a part of their exposure."""
    REJECTED = "rejected"
    """It should be bright or dark and is of no use; a reason is given."""


Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_SURE_S, _SURE_SHARE = 0.0005, 0.25
"""So exactly are the edges of a steady flash known, and by this share of its straying less those of another: a frame
that near to one is not called whole."""


@dataclass(frozen=True)
class FlashFrame:
    """One frame.

    Attributes:
        index: in order of presentation, from 0.
        time_s: presentation time.
        kind: what it is.
        reason: why it is rejected; else empty.
        flash: number of the flash nearest to it, from 0.
        lit_share: of its exposure, mean over the rows, 0..1.
    """

    index: int
    time_s: float
    kind: FrameClass
    reason: str
    flash: int
    lit_share: float


@dataclass(frozen=True, eq=False)
class Flashes:
    """What a blinking light did to a video.

    Attributes:
        frames: of the whole video.
        schedule: when the light was on.
        shutter: the camera's, as far as partial frames tell it.
        strength: (flashes,) light that each adds, relative to the usual; NaN for one without a bright frame.
        signal: the curve from which all this was found.
    """

    frames: tuple[FlashFrame, ...]
    schedule: FlashSchedule
    shutter: RollingShutter
    strength: Floats
    signal: FlashSignal

    def indices(self, kind: FrameClass) -> Indices:
        """Growing indices (count,) of the frames of a kind."""
        return np.array([frame.index for frame in self.frames if frame.kind is kind], np.intp)

    @property
    def times_s(self) -> Floats:
        """Presentation times (frames,)."""
        return np.array([frame.time_s for frame in self.frames])


def detect_flashes(brightness: BrightnessGrid, circle: FaceCircle | None = None) -> Flashes:
    """Find the flashes and say of each frame what it is.

    Args:
        brightness: brightness of the whole video.
        circle: of the face, where it is known.

    Raises:
        CaptureError: nothing blinks; the light is on all the time; it blinks too fast for the frame rate; too few
            frames are bright. The message says what to do.
    """
    reached = reached_cells(brightness, circle)
    beat = find_flash_frequency(mean_level(brightness, reached), brightness.times_s)
    signal = extract_flash_signal(brightness, beat.frequency_hz, reached)
    edges = find_flash_edges(signal.level, brightness.times_s, beat.frequency_hz)
    require_blinking(signal.level, brightness.interval_s, beat, edges)
    edges, shutter = fit_rolling_shutter(brightness, signal, edges, beat.frequency_hz)
    schedule = schedule_from_edges(edges)
    flash = schedule.flash_of(brightness.times_s, shutter)
    bright, dark = _whole_frames(brightness.times_s, schedule, shutter)
    require_fully_lit_frames(
        schedule.frequency_hz, brightness.interval_s, len(np.unique(flash[bright])) / len(np.unique(flash))
    )
    reasons = find_outlier_frames(BrightnessBlocks.of(brightness, signal), bright, dark)
    strength = relative_flash_strengths(brightness, signal, np.setdiff1d(bright, list(reasons)), dark, flash)
    for index in bright.tolist():
        if strength[flash[index]] < MIN_FLASH_STRENGTH:
            reasons[index] = f"weak flash: {strength[flash[index]]:.0%} of the usual light"
    kinds = dict.fromkeys(bright.tolist(), FrameClass.BRIGHT) | dict.fromkeys(dark.tolist(), FrameClass.DARK)
    kinds |= dict.fromkeys(reasons, FrameClass.REJECTED)
    require_bright_frames(sum(kind is FrameClass.BRIGHT for kind in kinds.values()))
    lit = schedule.lit_shares(brightness.times_s, shutter).mean(axis=1)
    frames = [
        FlashFrame(index, time_s, kinds.get(index, FrameClass.PARTIAL), reasons.get(index, ""), number, share)
        for index, (time_s, number, share) in enumerate(
            zip(brightness.times_s.tolist(), flash.tolist(), lit.tolist(), strict=True)
        )
    ]
    return Flashes(tuple(frames), schedule, shutter, strength, signal)


def _whole_frames(times_s: Floats, schedule: FlashSchedule, shutter: RollingShutter) -> tuple[Indices, Indices]:
    """Indices of the frames that are lit wholly, and of those not at all, though an edge may be a little elsewhere."""
    sure_s = _SURE_S + _SURE_SHARE * shutter.jitter_s
    shorter = FlashSchedule(schedule.on_s + sure_s, schedule.off_s - sure_s).lit_shares(times_s, shutter)
    longer = FlashSchedule(schedule.on_s - sure_s, schedule.off_s + sure_s).lit_shares(times_s, shutter)
    return np.flatnonzero(shorter.min(axis=1) >= FULLY_LIT_FRACTION), np.flatnonzero(
        longer.max(axis=1) <= 1 - FULLY_LIT_FRACTION
    )


MIN_EXTREMA_CHANGE = 0.3
"""Least change from dark to bright as a share of the usual one; the thesis gives no figure."""
MAX_EXTREMA_GAP = 5
"""Frames between a bright frame and the dark one before or after it: more are an error of the recording."""


def classify_by_extrema(level: Floats) -> list[FrameClass]:
    """Kinds of frames by their mean brightness (frames,): extremes of three are bright and dark, all others partial.

    Neighbouring extremes between which the brightness changes too little, or that lie too far apart, are rejected.
    """
    kinds = [FrameClass.PARTIAL] * len(level)
    before, middle, after = level[:-2], level[1:-1], level[2:]
    highest, lowest = (middle > before) & (middle >= after), (middle < before) & (middle <= after)
    extremes = np.flatnonzero(highest | lowest) + 1
    for index in extremes:
        kinds[index] = FrameClass.BRIGHT if highest[index - 1] else FrameClass.DARK
    change = np.abs(np.diff(level[extremes]))
    usual = float(np.median(change)) if len(change) else 0.0
    for place, (one, other) in enumerate(pairwise(extremes)):
        if change[place] < MIN_EXTREMA_CHANGE * usual or other - one > MAX_EXTREMA_GAP:
            kinds[one] = kinds[other] = FrameClass.REJECTED
    return kinds
