"""The light's schedule as it was, and which share of each frame's exposure it lights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.flash.edges import Edges

Floats = NDArray[np.float64]

WHOLE = 0.98
"""Lit share of every row from which a frame counts as bright; what is missing to 1, and a frame counts as dark."""

_PLACES = np.linspace(0, 1, 33)


@dataclass(frozen=True)
class Shutter:
    """How the camera takes a picture.

    Attributes:
        exposure_s: of each row.
        readout_s: from the first row's exposure to the last one's; negative if the lowest comes first.
        by_columns: whether columns follow one another instead, as in a phone held upright.
        unsteady_s: how much the flashes' clock strays from one to the next; so much less are edges sure.
    """

    exposure_s: float
    readout_s: float
    by_columns: bool
    unsteady_s: float


@dataclass(frozen=True, eq=False)
class Schedule:
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

    def lit_shares(self, times_s: Floats, shutter: Shutter) -> Floats:
        """Share (frames, 33) of the exposure for which the light is on, from the first row to the last."""
        start = times_s[:, None] + shutter.readout_s * _PLACES
        return (self._on_before(start + shutter.exposure_s) - self._on_before(start)) / shutter.exposure_s

    def flash_of(self, times_s: Floats, shutter: Shutter) -> NDArray[np.intp]:
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


def schedule_of(edges: Edges) -> Schedule:
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
    return Schedule(on, np.concatenate([[on[0] + usual], off, [on[-1] + usual]]))
