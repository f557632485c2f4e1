"""Where the flashes of a film end: what follows in constant light, a face that talks and turns, is no part of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lombscargle

from relit_camera.base.array_types import Float64Array
from relit_camera.capture.film.flash.flash_schedule import MIN_FREQUENCY_HZ
from relit_camera.capture.film.flash.flash_signal import NOISE_FLOOR, BrightnessGrid


@dataclass(frozen=True)
class EndTunables:
    """What counts as the end.

    Attributes:
        window_s: length of the pieces in which the strength of the blinking is measured.
        least_strength: of that of most of the flashing pieces, below which nothing blinks. Flashes as weak are of no
            use for the capture either (`frame_classification.MIN_FLASH_STRENGTH`).
        least_flashing_s, least_coda_s: least durations of what blinks and of what follows.
        least_change: logarithm of the brightness, below which nothing blinks in the whole film.
    """

    window_s: float = 1.5
    least_strength: float = 0.15
    least_flashing_s: float = 4.0
    least_coda_s: float = 5.0
    least_change: float = 0.02


TUNABLES = EndTunables()
PIECES = 6
"""That begin within a window."""
STEP_HZ = 0.1
"""Distance of the frequencies that are tried."""
LEAST_FRAMES = 8
"""Of a piece."""


def count_flashing_frames(brightness: BrightnessGrid) -> int:
    """Number of frames up to the end of the flashes; all frames where nothing of length follows, or nothing blinks."""
    times_s = brightness.times_s
    level = np.log(brightness.cells.mean(axis=(1, 2), dtype=np.float64) + NOISE_FLOOR)
    middles = np.arange(times_s[0], times_s[-1], TUNABLES.window_s / PIECES)
    frequency_hz = _strongest_frequency(level, times_s, middles)
    strength = np.array([_strength(level, times_s, middle, frequency_hz) for middle in middles])
    # The strongest half of them: the rest may be a coda as long as the flashes.
    usual = float(np.median(np.sort(strength)[len(strength) // 2 :]))
    flashing = np.flatnonzero(strength > TUNABLES.least_strength * usual)
    if usual < TUNABLES.least_change or len(flashing) * TUNABLES.window_s / PIECES < TUNABLES.least_flashing_s:
        return len(times_s)
    # A piece whose middle is at the end has half of the strength that it had a window before.
    last = int(flashing[-1])
    half = 0.5 * strength[max(last - PIECES - 2, 0)]
    end_s = float(middles[last - int(np.argmax(strength[last::-1] >= half))])
    if times_s[-1] - end_s < TUNABLES.least_coda_s:
        return len(times_s)
    return int(np.searchsorted(times_s, end_s))


def _strongest_frequency(level: Float64Array, times_s: Float64Array, middles: Float64Array) -> float:
    """The frequency in Hz of the largest amplitude over all pieces: `find_flash_frequency` asks in each what is clear.

    A head that turns slowly is clear where nothing blinks, but changes the picture's brightness little.
    """
    fastest = 0.5 / float(np.median(np.diff(times_s)))
    frequencies = np.arange(MIN_FREQUENCY_HZ, max(fastest, MIN_FREQUENCY_HZ + STEP_HZ), STEP_HZ)
    power = np.zeros(len(frequencies))
    for middle in middles:
        inside = np.abs(times_s - middle) <= TUNABLES.window_s / 2
        if inside.sum() >= LEAST_FRAMES:
            times, values = times_s[inside] - middle, level[inside]
            flat = values - np.polynomial.Polynomial.fit(times, values, 2)(times)
            power += lombscargle(times, flat, 2 * np.pi * frequencies)
    return float(frequencies[int(power.argmax())])


def _strength(level: Float64Array, times_s: Float64Array, middle_s: float, frequency_hz: float) -> float:
    """Amplitude of a frequency in a piece of the level (frames,), which may rise or fall evenly beside."""
    inside = np.abs(times_s - middle_s) <= TUNABLES.window_s / 2
    if inside.sum() < LEAST_FRAMES:
        return 0.0
    times, values = times_s[inside] - middle_s, level[inside]
    phase = 2 * np.pi * frequency_hz * times
    terms = np.stack([np.cos(phase), np.sin(phase), np.ones_like(times), times, times**2], axis=1)
    fitted = np.linalg.lstsq(terms, values, rcond=None)[0]
    return float(np.hypot(fitted[0], fitted[1]))
