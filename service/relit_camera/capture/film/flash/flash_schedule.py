"""How often the light blinks.

When the light goes on and off, from frame to frame.

The light's schedule as it was, and which share of each frame's exposure it lights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import lombscargle

from relit_camera.capture.film.flash.flash_signal import NOISE_FLOOR

Floats = NDArray[np.float64]

MIN_FREQUENCY_HZ = 0.7
_WINDOW_S = 4.0
"""Spectra of pieces this long are averaged, so that a light whose clock drifts has a peak too."""
_STEP_HZ = 0.02


@dataclass(frozen=True)
class FlashFrequency:
    """A periodic change.

    Attributes:
        frequency_hz: how often.
        share: of the variance (of the logarithm) that its fundamental explains, 0..1.
    """

    frequency_hz: float
    share: float


def find_flash_frequency(level: Floats, times_s: Floats) -> FlashFrequency:
    """The strongest periodic change from 0.7 Hz up to half the frame rate (Lomb 1976, Scargle 1982: any frame times).

    Args:
        level: (frames,) brightness, linear.
        times_s: (frames,).
    """
    logarithm = np.log(level + NOISE_FLOOR)
    fastest = 0.5 / float(np.median(np.diff(times_s)))
    frequencies = np.arange(MIN_FREQUENCY_HZ, max(fastest, MIN_FREQUENCY_HZ + 2 * _STEP_HZ), _STEP_HZ)
    starts = np.arange(times_s[0], max(times_s[-1] - _WINDOW_S, times_s[0]) + 1e-9, _WINDOW_S / 2)
    spectra = []
    for start in starts:
        inside = (times_s >= start) & (times_s <= start + _WINDOW_S)
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


def _without_trend(times_s: Floats, values: Floats) -> Floats:
    """The values less a parabola: the moving light and the automatics are slow."""
    return np.asarray(values - np.polynomial.Polynomial.fit(times_s, values, 2)(times_s))


_WEAKEST = 0.04
"""Changes of level below this share of the usual one are no flash."""


@dataclass(frozen=True, eq=False)
class FlashEdges:
    """The moments at which the light goes on and off, in turns.

    Attributes:
        times_s: (edges,) growing, on the clock of the frames' first exposed row.
        rising: (edges,) whether it goes on.
        frame: (edges,) index of the last frame before the middle of the change.
    """

    times_s: Floats
    rising: NDArray[np.bool_]
    frame: NDArray[np.intp]

    def only(self, some: slice) -> FlashEdges:
        """Some of them."""
        return FlashEdges(self.times_s[some], self.rising[some], self.frame[some])


def find_flash_edges(level: Floats, times_s: Floats, frequency_hz: float) -> FlashEdges:
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
    return FlashEdges(times_s[frame] + np.clip(share, 0, 1) * (times_s[frame + 1] - times_s[frame]), rising, frame)


FULLY_LIT_FRACTION = 0.98
"""Lit share of every row from which a frame counts as bright; what is missing to 1, and a frame counts as dark."""

_PLACES = np.linspace(0, 1, 33)


@dataclass(frozen=True)
class RollingShutter:
    """How the camera takes a picture.

    Attributes:
        exposure_s: of each row.
        readout_s: from the first row's exposure to the last one's; negative if the lowest comes first.
        by_columns: whether columns follow one another instead, as in a phone held upright.
        jitter_s: how much the flashes' clock strays from one to the next; so much less are edges sure.
    """

    exposure_s: float
    readout_s: float
    by_columns: bool
    jitter_s: float


@dataclass(frozen=True, eq=False)
class FlashSchedule:
    """When the light is on.

    Attributes:
        on_s, off_s: (flashes,) growing; at the video's beginning and end as usual.
    """

    on_s: Floats
    off_s: Floats

    @property
    def frequency_hz(self) -> float:
        """Of the flashes, their median; 0 of a single one."""
        return float(1 / np.median(np.diff(self.on_s))) if len(self.on_s) > 1 else 0.0

    @property
    def duty(self) -> float:
        """Share of the time that the light is on."""
        return float(np.median(self.off_s - self.on_s)) * self.frequency_hz

    def lit_shares(self, times_s: Floats, shutter: RollingShutter) -> Floats:
        """Share (frames, 33) of the exposure for which the light is on, from the first row to the last."""
        start = times_s[:, None] + shutter.readout_s * _PLACES
        return (self._on_before(start + shutter.exposure_s) - self._on_before(start)) / shutter.exposure_s

    def flash_of(self, times_s: Floats, shutter: RollingShutter) -> NDArray[np.intp]:
        """The flash (frames,) whose middle is nearest to each frame's."""
        middle = (self.on_s + self.off_s) / 2
        frame = times_s + (shutter.readout_s + shutter.exposure_s) / 2
        return np.asarray(np.abs(frame[:, None] - middle).argmin(axis=1), np.intp)

    def _on_before(self, time_s: Floats) -> Floats:
        """Seconds (...) for which it was on until then."""
        times = np.stack([self.on_s, self.off_s], axis=1).ravel()
        lit = np.concatenate([[0.0], np.cumsum(self.off_s - self.on_s)])
        known = np.stack([lit[:-1], lit[1:]], axis=1).ravel()
        return np.asarray(np.interp(time_s, times, known))


def schedule_from_edges(edges: FlashEdges) -> FlashSchedule:
    """The schedule that these edges tell, and one flash more at either end: its edge may be just outside of the video.

    There must be two flashes with both their edges, at least.
    """
    on, off = edges.times_s[edges.rising], edges.times_s[~edges.rising]
    period, first_on, last_on = float(np.median(np.diff(on))), edges.rising[0], edges.rising[-1]
    usual = float(np.median((off if first_on else off[1:])[: len(on) - last_on] - on[: len(on) - last_on]))
    if not first_on:
        on = np.append(off[0] - usual, on)
    if last_on:
        off = np.append(off, on[-1] + usual)
    on = np.concatenate([[on[0] - period], on, [on[-1] + period]])
    return FlashSchedule(on, np.concatenate([[on[0] + usual], off, [on[-1] + usual]]))
