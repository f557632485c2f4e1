"""Bright, dark, partial or rejected: what each frame of a video is good for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.face_circle import Circle
from relit_camera.capture.flash.brightness import Brightness
from relit_camera.capture.flash.doubts import WEAKEST, strengths, unlike_neighbours
from relit_camera.capture.flash.edges import find_edges
from relit_camera.capture.flash.frequency import find_beat
from relit_camera.capture.flash.kind import Kind
from relit_camera.capture.flash.lit_shares import Blocks
from relit_camera.capture.flash.refusals import refuse_too_fast, refuse_too_few, refuse_unless_blinking
from relit_camera.capture.flash.schedule import WHOLE, Schedule, Shutter, schedule_of
from relit_camera.capture.flash.shutter import fit_shutter
from relit_camera.capture.flash.signal import Signal, flash_signal, level_of, reached_cells

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
    kind: Kind
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
    schedule: Schedule
    shutter: Shutter
    strength: Floats
    signal: Signal

    def indices(self, kind: Kind) -> Indices:
        """Growing indices (count,) of the frames of a kind."""
        return np.array([frame.index for frame in self.frames if frame.kind is kind], np.intp)

    @property
    def times_s(self) -> Floats:
        """Presentation times (frames,)."""
        return np.array([frame.time_s for frame in self.frames])


def find_flashes(seen: Brightness, circle: Circle | None = None) -> Flashes:
    """Find the flashes and say of each frame what it is.

    Args:
        seen: brightness of the whole video.
        circle: of the face, where it is known.

    Raises:
        CaptureError: nothing blinks; the light is on all the time; it blinks too fast for the frame rate; too few
            frames are bright. The message says what to do.
    """
    reached = reached_cells(seen, circle)
    beat = find_beat(level_of(seen, reached), seen.times_s)
    signal = flash_signal(seen, beat.frequency_hz, reached)
    edges = find_edges(signal.level, seen.times_s, beat.frequency_hz)
    refuse_unless_blinking(signal.level, seen.interval_s, beat, edges)
    edges, shutter = fit_shutter(seen, signal, edges, beat.frequency_hz)
    schedule = schedule_of(edges)
    flash = schedule.flash_of(seen.times_s, shutter)
    bright, dark = _whole_frames(seen.times_s, schedule, shutter)
    refuse_too_fast(schedule.frequency_hz, seen.interval_s, len(np.unique(flash[bright])) / len(np.unique(flash)))
    reasons = unlike_neighbours(Blocks.of(seen, signal), bright, dark)
    strength = strengths(seen, signal, np.setdiff1d(bright, list(reasons)), dark, flash)
    for index in bright.tolist():
        if strength[flash[index]] < WEAKEST:
            reasons[index] = f"weak flash: {strength[flash[index]]:.0%} of the usual light"
    kinds = dict.fromkeys(bright.tolist(), Kind.BRIGHT) | dict.fromkeys(dark.tolist(), Kind.DARK)
    kinds |= dict.fromkeys(reasons, Kind.REJECTED)
    refuse_too_few(sum(kind is Kind.BRIGHT for kind in kinds.values()))
    lit = schedule.lit_shares(seen.times_s, shutter).mean(axis=1)
    frames = [
        FlashFrame(index, time_s, kinds.get(index, Kind.PARTIAL), reasons.get(index, ""), number, share)
        for index, (time_s, number, share) in enumerate(
            zip(seen.times_s.tolist(), flash.tolist(), lit.tolist(), strict=True)
        )
    ]
    return Flashes(tuple(frames), schedule, shutter, strength, signal)


def _whole_frames(times_s: Floats, schedule: Schedule, shutter: Shutter) -> tuple[Indices, Indices]:
    """Indices of the frames that are lit wholly, and of those not at all, though an edge may be a little elsewhere."""
    sure_s = _SURE_S + _SURE_SHARE * shutter.unsteady_s
    shorter = Schedule(schedule.on_s + sure_s, schedule.off_s - sure_s).lit_shares(times_s, shutter)
    longer = Schedule(schedule.on_s - sure_s, schedule.off_s + sure_s).lit_shares(times_s, shutter)
    return np.flatnonzero(shorter.min(axis=1) >= WHOLE), np.flatnonzero(longer.max(axis=1) <= 1 - WHOLE)
