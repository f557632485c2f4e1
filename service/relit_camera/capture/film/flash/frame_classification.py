"""The class of every frame: bright, dark, partial, or rejected.

Films with too few bright frames are refused here (`require_fully_lit_frames`, `require_bright_frames`).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.exposure_fractions import BrightnessBlocks
from relit_camera.capture.film.flash.flash_schedule import (
    FULLY_LIT_FRACTION,
    FlashSchedule,
    RollingShutter,
    find_flash_edges,
    find_flash_frequency,
    require_flashing,
    schedule_from_edges,
)
from relit_camera.capture.film.flash.flash_signal import (
    BrightnessGrid,
    FlashSignal,
    extract_flash_signal,
    mean_level,
    reached_cells,
)
from relit_camera.capture.film.flash.rolling_shutter import fit_rolling_shutter

MIN_BRIGHT_FRAMES = 8
"""Least bright frames of a film."""
MIN_FLASH_STRENGTH = 0.4
"""Least light of a flash, relative to the median: a weaker one points elsewhere or comes from too far."""


@dataclass(frozen=True)
class ClassTunables:
    """What frames are good for; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        edge_error_s, edge_jitter: standard error of an edge, of a steady flash and as a fraction of its jitter; frames
            nearer to an edge are partial.
        min_whole_flashes: fraction of the flashes that must light a whole frame; with fewer, they are too fast.
        min_lit, min_lit_alone: a block of a bright frame is an outlier with less than this fraction of the light that
            its neighbors in time and the rest of the frame make one expect; the second where the frame is the only one
            of its flash, as the light moves from flash to flash.
        max_stray: a block of a dark frame is an outlier with more than this fraction of the flash's light.
        alone_frames: distance to the nearest bright frame beyond which that belongs to another flash.
        min_height: blocks are not judged where the flash adds less than this fraction of the median.
        strength_percentile: percentile of the light that a flash adds to the cells: that of what faces it.
        dark_frames: nearest dark frames whose mean is subtracted from a flash.
    """

    edge_error_s: float = 0.0005
    edge_jitter: float = 0.25
    min_whole_flashes: float = 0.4
    min_lit: float = 0.75
    min_lit_alone: float = 0.5
    max_stray: float = 0.1
    alone_frames: int = 2
    min_height: float = 0.3
    strength_percentile: float = 98
    dark_frames: int = 4


_TUNABLES = ClassTunables()


class FrameClass(StrEnum):
    """The class of a frame, as named in the report of a capture."""

    BRIGHT = "bright"
    """The flash lit all of it for the whole exposure."""
    DARK = "dark"
    """The flash lit none of it."""
    PARTIAL = "partial"
    """The flash lit some rows, or all for a part of the exposure."""
    REJECTED = "rejected"
    """It should be bright or dark but is of no use; the frame has a reason."""


@dataclass(frozen=True)
class FlashFrame:
    """A frame of a film.

    Attributes:
        index: in order of presentation, from 0.
        time_s: presentation time.
        kind: its class.
        reason: why it is rejected, else empty.
        flash: number of the nearest flash, from 0.
        exposure_fraction: fraction of its exposure for which the flash was on, mean over the rows, 0..1.
    """

    index: int
    time_s: float
    kind: FrameClass
    reason: str
    flash: int
    exposure_fraction: float


@dataclass(frozen=True, eq=False)
class Flashes:
    """The flashes of a film, and the class of every frame.

    Attributes:
        frames: all frames of the film.
        schedule: when the light was on.
        shutter: the camera's, as far as partly lit frames show it.
        strength: (flashes,) light that each flash adds, relative to the median; NaN of one without a bright frame.
        signal: the brightness from which all this was found.
    """

    frames: tuple[FlashFrame, ...]
    schedule: FlashSchedule
    shutter: RollingShutter
    strength: Float64Array
    signal: FlashSignal

    def indices(self, kind: FrameClass) -> Indices:
        """Growing indices (count,) of the frames of a class."""
        return np.array([frame.index for frame in self.frames if frame.kind is kind], np.intp)

    @property
    def times_s(self) -> Float64Array:
        """Presentation times (frames,)."""
        return np.array([frame.time_s for frame in self.frames])


def detect_flashes(brightness: BrightnessGrid, circle: FaceCircle | None = None) -> Flashes:
    """Find the flashes of a film and classify its frames.

    Args:
        brightness: of the whole film.
        circle: of the face, where it is known; only what it contains counts then.

    Raises:
        CaptureError: nothing blinks; the light is on all the time; it blinks too fast for the frame rate; too few
            frames are bright. The message says what to do.
    """
    reached = reached_cells(brightness, circle)
    beat = find_flash_frequency(mean_level(brightness, reached), brightness.times_s)
    signal = extract_flash_signal(brightness, beat.frequency_hz, reached)
    edges = find_flash_edges(signal.level, brightness.times_s, beat.frequency_hz)
    require_flashing(signal.level, brightness.interval_s, beat, edges)
    edges, shutter = fit_rolling_shutter(brightness, signal, edges, beat.frequency_hz)
    schedule = schedule_from_edges(edges)
    flash = schedule.flash_of(brightness.times_s, shutter)
    bright, dark = _bright_and_dark(brightness.times_s, schedule, shutter)
    require_fully_lit_frames(
        schedule.frequency_hz, brightness.interval_s, len(np.unique(flash[bright])) / len(np.unique(flash))
    )
    reasons = find_outlier_frames(BrightnessBlocks.from_grid(brightness, signal), bright, dark)
    strength = relative_flash_strengths(brightness, signal, np.setdiff1d(bright, list(reasons)), dark, flash)
    for index in bright.tolist():
        if strength[flash[index]] < MIN_FLASH_STRENGTH:
            reasons[index] = f"weak flash: {strength[flash[index]]:.0%} of the usual light"
    kinds = dict.fromkeys(bright.tolist(), FrameClass.BRIGHT) | dict.fromkeys(dark.tolist(), FrameClass.DARK)
    kinds |= dict.fromkeys(reasons, FrameClass.REJECTED)
    require_bright_frames(sum(kind is FrameClass.BRIGHT for kind in kinds.values()))
    fractions = schedule.exposure_fractions(brightness.times_s, shutter).mean(axis=1)
    frames = [
        FlashFrame(index, time_s, kinds.get(index, FrameClass.PARTIAL), reasons.get(index, ""), number, fraction)
        for index, (time_s, number, fraction) in enumerate(
            zip(brightness.times_s.tolist(), flash.tolist(), fractions.tolist(), strict=True)
        )
    ]
    return Flashes(tuple(frames), schedule, shutter, strength, signal)


def _bright_and_dark(
    times_s: Float64Array, schedule: FlashSchedule, shutter: RollingShutter
) -> tuple[Indices, Indices]:
    """Indices of the fully lit frames and of the unlit ones, leaving out those that an edge's error could change."""
    error_s = _TUNABLES.edge_error_s + _TUNABLES.edge_jitter * shutter.jitter_s
    shorter = FlashSchedule(schedule.on_s + error_s, schedule.off_s - error_s).exposure_fractions(times_s, shutter)
    longer = FlashSchedule(schedule.on_s - error_s, schedule.off_s + error_s).exposure_fractions(times_s, shutter)
    bright = np.flatnonzero(shorter.min(axis=1) >= FULLY_LIT_FRACTION)
    return bright, np.flatnonzero(longer.max(axis=1) <= 1 - FULLY_LIT_FRACTION)


def find_outlier_frames(blocks: BrightnessBlocks, bright: Indices, dark: Indices) -> dict[int, str]:
    """Reasons to reject frames, by index: some block is not lit as in the frames of their class before and after.

    A block is compared with the rest of its frame too, since camera gains may vary from frame to frame.

    Args:
        blocks: brightness of blocks of the picture.
        bright: growing indices of the bright frames.
        dark: growing indices of the dark frames.
    """
    if len(bright) < 3 or len(dark) < 3:
        return {}
    lit, unlit = blocks.between(bright), blocks.between(dark)
    height = np.maximum(lit - unlit, 1e-9)
    clear = height > _TUNABLES.min_height * np.median(height[bright])
    fractions = ((blocks.level - unlit) / height)[bright]
    gap = np.diff(bright, prepend=-_TUNABLES.alone_frames - 1, append=2 * bright[-1])
    alone = np.minimum(gap[:-1], gap[1:]) > _TUNABLES.alone_frames
    least = np.where(alone, _TUNABLES.min_lit_alone, _TUNABLES.min_lit)
    missing = (fractions < np.median(fractions, axis=1, keepdims=True) * least[:, None]) & clear[bright]
    of_frame = np.median(blocks.level / np.maximum(unlit, 1e-9), axis=1, keepdims=True)
    stray = ((blocks.level - of_frame * unlit) / height > _TUNABLES.max_stray)[dark]
    outliers = [(bright[missing.any(axis=1)], "bright"), (dark[(stray & clear[dark]).any(axis=1)], "dark")]
    return {int(index): f"not lit like the {kind} frames beside it" for found, kind in outliers for index in found}


def relative_flash_strengths(
    brightness: BrightnessGrid, signal: FlashSignal, bright: Indices, dark: Indices, flash: Indices
) -> Float64Array:
    """Light (flashes,) that each flash adds, relative to the median; NaN of a flash without a bright frame.

    Args:
        brightness: of the film.
        signal: the gains, and which cells the flash reaches.
        bright: growing indices of the bright frames.
        dark: growing indices of the dark frames.
        flash: (frames,) number of each frame's flash.
    """
    added = np.full(int(flash.max()) + 1, np.nan)
    if not len(bright) or not len(dark):
        return added
    steady = brightness.cells[:, signal.reached] / signal.gains[:, None]
    count = _TUNABLES.dark_frames
    for each in np.unique(flash[bright]):
        lit = bright[flash[bright] == each]
        first = int(np.clip(np.searchsorted(dark, lit[0]) - count // 2, 0, max(0, len(dark) - count)))
        without = steady[dark[first : first + count]].mean(axis=0)
        added[each] = np.percentile(steady[lit].mean(axis=0) - without, _TUNABLES.strength_percentile)
    return np.asarray(added / np.nanmedian(added))


def require_fully_lit_frames(frequency_hz: float, interval_s: float, whole: float) -> None:
    """Check that enough flashes light a whole frame.

    Args:
        frequency_hz: of the flashes.
        interval_s: from frame to frame.
        whole: fraction of the flashes that light a whole frame.

    Raises:
        CaptureError: too few do.
    """
    if whole < _TUNABLES.min_whole_flashes:
        rate = 1 / interval_s
        what = f"the light blinks {frequency_hz:.1f} times a second, too fast for {rate:.0f} frames a second"
        cure = f"let it blink at most {rate / 6:.0f} times a second, or make the room a little brighter"
        raise CaptureError(f"{what}: {whole:.0%} of the flashes light a whole frame", cure)


def require_bright_frames(bright: int) -> None:
    """Check that there are enough bright frames.

    Raises:
        CaptureError: there are not.
    """
    if bright < MIN_BRIGHT_FRAMES:
        cure = "record half a minute or more, the light about a metre away and pointing at the face"
        raise CaptureError(f"the flash lights only {bright} frames wholly and strongly enough", cure)
