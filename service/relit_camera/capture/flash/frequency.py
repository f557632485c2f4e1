"""How often the light blinks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lombscargle

from relit_camera.capture.flash.signal import FLOOR

Floats = NDArray[np.float64]

SLOWEST_HZ = 0.7
_WINDOW_S = 4.0
"""Spectra of pieces this long are averaged, so that a light whose clock drifts has a peak too."""
_STEP_HZ = 0.02


@dataclass(frozen=True)
class Beat:
    """A periodic change.

    Attributes:
        frequency_hz: how often.
        share: of the variance (of the logarithm) that its fundamental explains, 0..1.
    """

    frequency_hz: float
    share: float


def find_beat(level: Floats, times_s: Floats) -> Beat:
    """The strongest periodic change from 0.7 Hz up to half the frame rate (Lomb 1976, Scargle 1982: any frame times).

    Args:
        level: (frames,) brightness, linear.
        times_s: (frames,).
    """
    logarithm = np.log(level + FLOOR)
    fastest = 0.5 / float(np.median(np.diff(times_s)))
    frequencies = np.arange(SLOWEST_HZ, max(fastest, SLOWEST_HZ + 2 * _STEP_HZ), _STEP_HZ)
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
        return Beat(float(frequencies[0]), 0.0)
    spectrum = np.mean(spectra, axis=0)
    peak = int(spectrum.argmax())
    return Beat(float(frequencies[peak]), float(spectrum[peak]))


def _without_trend(times_s: Floats, values: Floats) -> Floats:
    """The values less a parabola: the moving light and the automatics are slow."""
    return np.asarray(values - np.polynomial.Polynomial.fit(times_s, values, 2)(times_s))
