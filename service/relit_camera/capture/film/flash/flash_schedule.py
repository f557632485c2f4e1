"""When the light was on: its frequency, the moments at which it went on and off, and the schedule made of them.

Films in which nothing blinks are refused here (`require_flashing`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import lombscargle

from relit_camera.base.array_types import Float64Array
from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.flash.flash_signal import NOISE_FLOOR

MIN_FREQUENCY_HZ = 0.7
"""Slowest flashes that are looked for."""
MIN_FLASHES = 8
"""Least flashes of a film."""
FULLY_LIT_FRACTION = 0.98
"""A frame is bright if every row has at least this exposure fraction, and dark if every row has at most 1 less this."""
_SHUTTER_ROWS = np.linspace(0, 1, 33)
"""Rows (or columns) at which exposure fractions are computed, as fractions of the picture's height (or width)."""


@dataclass(frozen=True)
class BlinkTunables:
    """What counts as blinking; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        window_s: length of the pieces whose spectra are averaged, so that a drifting frequency has one peak too.
        step_hz: distance of the frequencies that are tried.
        window_periods: length of the window in which the darkest and the brightest frame are sought.
        min_height: change of the level, relative to the 90th percentile, that counts as an edge.
        min_variance_fraction: least fraction of the variance that the frequency explains.
        min_contrast: least ratio of bright to dark.
        min_step: least fraction of the whole change that a flash makes from one frame to the next; a slow wave makes
            less.
        slow_frames: frames per period from which `min_step` applies.
        changing: ratio of brightness over a film in which a light was on all the time.
    """

    window_s: float = 4.0
    step_hz: float = 0.02
    window_periods: float = 1.1
    min_height: float = 0.04
    min_variance_fraction: float = 0.2
    min_contrast: float = 1.15
    min_step: float = 0.25
    slow_frames: float = 8
    changing: float = 1.5


_TUNABLES = BlinkTunables()


@dataclass(frozen=True)
class FlashFrequency:
    """The frequency of a periodic change.

    Attributes:
        frequency_hz: of its fundamental.
        fraction: of the variance of the logarithm that the fundamental explains, 0..1.
    """

    frequency_hz: float
    fraction: float


def find_flash_frequency(level: Float64Array, times_s: Float64Array) -> FlashFrequency:
    """The strongest periodic change from 0.7 Hz to half the frame rate, by Lomb-Scargle periodograms.

    These need no even frame times (Lomb 1976, Scargle 1982).

    Args:
        level: (frames,) linear brightness.
        times_s: (frames,).
    """
    logarithm = np.log(level + NOISE_FLOOR)
    fastest = 0.5 / float(np.median(np.diff(times_s)))
    frequencies = np.arange(MIN_FREQUENCY_HZ, max(fastest, MIN_FREQUENCY_HZ + 2 * _TUNABLES.step_hz), _TUNABLES.step_hz)
    starts = np.arange(times_s[0], max(times_s[-1] - _TUNABLES.window_s, times_s[0]) + 1e-9, _TUNABLES.window_s / 2)
    spectra = []
    for start in starts:
        inside = (times_s >= start) & (times_s <= start + _TUNABLES.window_s)
        if inside.sum() < 6:
            continue
        piece = _without_trend(times_s[inside], logarithm[inside])
        if np.ptp(piece) > 1e-9:
            spectra.append(lombscargle(times_s[inside], piece, 2 * np.pi * frequencies, normalize=True))
    if not spectra:
        return FlashFrequency(float(frequencies[0]), 0.0)
    spectrum = np.mean(spectra, axis=0)
    peak = int(spectrum.argmax())
    return FlashFrequency(float(frequencies[peak]), float(spectrum[peak]))


def _without_trend(times_s: Float64Array, values: Float64Array) -> Float64Array:
    """The values less a fitted parabola, as which the slow changes by a moving light and camera gains count."""
    return np.asarray(values - np.polynomial.Polynomial.fit(times_s, values, 2)(times_s))


@dataclass(frozen=True, eq=False)
class FlashEdges:
    """The moments at which the light goes on and off, by turns.

    Attributes:
        times_s: (edges,) growing, on the clock of the frames' first exposed row.
        rising: (edges,) whether the light goes on.
        frame: (edges,) index of the last frame before the middle of the change.
    """

    times_s: Float64Array
    rising: NDArray[np.bool_]
    frame: NDArray[np.intp]

    def subset(self, some: slice) -> FlashEdges:
        """Some of the edges."""
        return FlashEdges(self.times_s[some], self.rising[some], self.frame[some])


def find_flash_edges(level: Float64Array, times_s: Float64Array, frequency_hz: float) -> FlashEdges:
    """Moments at which the level crosses the middle between its local extremes, interpolated between frames.

    Args:
        level: (frames,) linear brightness.
        times_s: (frames,).
        frequency_hz: of the flashes, about.
    """
    low, high = _local_extremes(level, float(np.median(np.diff(times_s))), frequency_hz)
    middle, height = (low + high) / 2, high - low
    above = level > middle
    frame = np.flatnonzero(above[1:] != above[:-1])
    frame = frame[height[frame] > _TUNABLES.min_height * np.percentile(height, 90)]
    rising = above[frame + 1]
    # By turns: a fall too weak to count leaves two rises in a row.
    kept = np.ones(len(frame), bool)
    kept[:-1] &= ~(rising[:-1] & rising[1:])
    kept[1:] &= ~(~rising[1:] & ~rising[:-1])
    frame, rising = frame[kept], rising[kept]
    # Where the level does not change, it is the middle that crosses it.
    step = level[frame + 1] - level[frame]
    fraction = np.divide(middle[frame] - level[frame], step, out=np.full(len(frame), 0.5), where=step != 0)
    return FlashEdges(times_s[frame] + np.clip(fraction, 0, 1) * (times_s[frame + 1] - times_s[frame]), rising, frame)


def _local_extremes(level: Float64Array, interval_s: float, frequency_hz: float) -> tuple[Float64Array, Float64Array]:
    """Minimum and maximum (frames,) of the level (frames,) in a window of about a period around each frame."""
    window = max(3, round(_TUNABLES.window_periods / frequency_hz / interval_s))
    return np.asarray(minimum_filter1d(level, window)), np.asarray(maximum_filter1d(level, window))


def require_flashing(level: Float64Array, interval_s: float, beat: FlashFrequency, edges: FlashEdges) -> None:
    """Check that the level goes up and down as that of a blinking light does, often enough.

    Args:
        level: (frames,) linear brightness.
        interval_s: from frame to frame.
        beat: the strongest periodic change.
        edges: of the level.

    Raises:
        CaptureError: it does not: the light is on all the time, there is none, or the film is too short.
    """
    low, high = _local_extremes(level, interval_s, beat.frequency_hz)
    contrast = float(np.median(high / np.maximum(low, 1e-6)))
    step = np.abs(level[edges.frame + 1] - level[edges.frame]) / np.maximum((high - low)[edges.frame], 1e-9)
    slow = 1 / beat.frequency_hz / interval_s >= _TUNABLES.slow_frames
    blinks = beat.fraction >= _TUNABLES.min_variance_fraction and contrast >= _TUNABLES.min_contrast and len(step) > 0
    if not blinks or (slow and np.median(step) < _TUNABLES.min_step):
        ratio = float(np.percentile(level, 98) / max(np.percentile(level, 2), 1e-6))
        if ratio > _TUNABLES.changing:
            what = f"no flash found: the brightness changes by a factor of {ratio:.1f}, but nothing blinks"
            raise CaptureError(what, "the light must not be on all the time: let it blink, about five times a second")
        what = f"no flash found: the brightness stays within {ratio - 1:.0%}"
        raise CaptureError(what, "let a light blink about five times a second, a metre away, in a dim room")
    flashes = int(edges.rising.sum())
    if flashes < MIN_FLASHES:
        raise CaptureError(f"only {flashes} flashes found", "record half a minute or more of the blinking light")


@dataclass(frozen=True)
class RollingShutter:
    """A camera's rolling shutter.

    Attributes:
        exposure_s: exposure time of each row.
        readout_s: from the exposure of the first row to that of the last; negative if the lowest is read first.
        by_columns: whether columns are read one after another instead, as with a phone held upright.
        jitter_s: deviation of the flashes from a regular period, from one to the next; edges are so much less certain.
    """

    exposure_s: float
    readout_s: float
    by_columns: bool
    jitter_s: float


@dataclass(frozen=True, eq=False)
class FlashSchedule:
    """When the light was on.

    Attributes:
        on_s, off_s: (flashes,) growing times; at the film's beginning and end extrapolated.
    """

    on_s: Float64Array
    off_s: Float64Array

    @property
    def frequency_hz(self) -> float:
        """Median frequency of the flashes; 0 of a single one."""
        return float(1 / np.median(np.diff(self.on_s))) if len(self.on_s) > 1 else 0.0

    @property
    def duty(self) -> float:
        """Fraction of the time for which the light is on."""
        return float(np.median(self.off_s - self.on_s)) * self.frequency_hz

    def exposure_fractions(self, times_s: Float64Array, shutter: RollingShutter) -> Float64Array:
        """Share (frames, 33) of the exposure for which the light is on, at 33 rows from the first to the last."""
        start = times_s[:, None] + shutter.readout_s * _SHUTTER_ROWS
        return (self._on_before(start + shutter.exposure_s) - self._on_before(start)) / shutter.exposure_s

    def flash_of(self, times_s: Float64Array, shutter: RollingShutter) -> NDArray[np.intp]:
        """Number (frames,) of the flash whose middle is nearest to that of each frame."""
        middle = (self.on_s + self.off_s) / 2
        frame = times_s + (shutter.readout_s + shutter.exposure_s) / 2
        return np.asarray(np.abs(frame[:, None] - middle).argmin(axis=1), np.intp)

    def _on_before(self, time_s: Float64Array) -> Float64Array:
        """Seconds (...) for which the light was on before times (...)."""
        times = np.stack([self.on_s, self.off_s], axis=1).ravel()
        lit = np.concatenate([[0.0], np.cumsum(self.off_s - self.on_s)])
        known = np.stack([lit[:-1], lit[1:]], axis=1).ravel()
        return np.asarray(np.interp(time_s, times, known))


def schedule_from_edges(edges: FlashEdges) -> FlashSchedule:
    """The schedule of these edges, with one more flash at either end, whose edge may be just outside the film.

    At least two flashes must have both their edges.
    """
    on, off = edges.times_s[edges.rising], edges.times_s[~edges.rising]
    period, first_on, last_on = float(np.median(np.diff(on))), edges.rising[0], edges.rising[-1]
    duration = float(np.median((off if first_on else off[1:])[: len(on) - last_on] - on[: len(on) - last_on]))
    if not first_on:
        on = np.append(off[0] - duration, on)
    if last_on:
        off = np.append(off, on[-1] + duration)
    on = np.concatenate([[on[0] - period], on, [on[-1] + period]])
    return FlashSchedule(on, np.concatenate([[on[0] + duration], off, [on[-1] + duration]]))
