"""One curve from a grid of brightness: what the flash reaches, made good for what the camera's automatics did."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.face_circle import Circle
from relit_camera.capture.flash.brightness import Brightness

Floats = NDArray[np.float64]

FLOOR = 1e-4
"""Brightness below this is the camera's noise."""

_RESPONDS = 0.5
"""Share of the strongest response, in logarithms, from which a cell counts as reached by the flash."""
_UNREACHED, _LEAST_FOLLOWING = 0.1, 5
"""A cell goes along with the automatics alone if it follows the flash by at most so much more than the least following
ones (percentile) do. Automatics follow the flash too, mostly against it."""
_NOT_REACHED_AT_ALL = 0.35
"""If even those follow the flash by this share, it reaches everything."""
_VISIBLE = 0.003
_MIN_UNREACHED = 0.04
"""Share of all cells that must be unreached, so that they can stand for the automatics."""


@dataclass(frozen=True, eq=False)
class Signal:
    """What the flash does to the picture.

    Attributes:
        level: (frames,) brightness of what the flash reaches, linear, gains divided out.
        reached: (rows, columns) which cells those are.
        gains: (frames,) brightness of what it does not reach, relative to its mean; 1 where there is no such part.
    """

    level: Floats
    reached: NDArray[np.bool_]
    gains: Floats

    @property
    def knows_gains(self) -> bool:
        """Whether there was anything that the flash does not reach."""
        return bool(np.ptp(self.gains) > 0)


def reached_cells(seen: Brightness, circle: Circle | None = None) -> NDArray[np.bool_]:
    """Which cells (rows, columns) change most over the video, in ratio; of those in `circle` where it is given."""
    cells = seen.cells.astype(np.float64) + FLOOR
    response = np.log(np.percentile(cells, 95, axis=0) / np.percentile(cells, 5, axis=0))
    inside = np.ones(response.shape, bool) if circle is None else _inside(circle, seen)
    if not inside.any():
        inside[:] = True
    return np.asarray(inside & (response >= _RESPONDS * np.percentile(response[inside], 95)))


def flash_signal(seen: Brightness, frequency_hz: float, reached: NDArray[np.bool_]) -> Signal:
    """The curve of a light that blinks at about this frequency."""
    logarithm = np.log(seen.cells.astype(np.float64) + FLOOR)
    lag = max(1, round(0.5 / frequency_hz / seen.interval_s))
    change = logarithm[lag:] - logarithm[:-lag]
    common = np.log(level_of(seen, reached) + FLOOR)
    common = common[lag:] - common[:-lag]
    follows = np.tensordot(common, change, axes=1) / max(float(common @ common), 1e-12)
    visible = seen.cells.mean(axis=0) > _VISIBLE
    least = float(np.percentile(follows[visible], _LEAST_FOLLOWING)) if visible.any() else 1.0
    unreached = visible & (follows < least + _UNREACHED)
    gains = np.ones(len(logarithm))
    if least < _NOT_REACHED_AT_ALL and unreached.mean() >= _MIN_UNREACHED:
        still = logarithm[:, unreached]
        gains = np.exp(np.median(still - still.mean(axis=0), axis=1))
    return Signal(level_of(seen, reached) / gains, reached, gains)


def level_of(seen: Brightness, reached: NDArray[np.bool_]) -> Floats:
    """Mean brightness (frames,) of these cells (rows, columns)."""
    return np.asarray(seen.cells[:, reached].mean(axis=1), np.float64)


def _inside(circle: Circle, seen: Brightness) -> NDArray[np.bool_]:
    rows, columns = seen.cells.shape[1:]
    x = (np.arange(columns) + 0.5) * seen.size[0] / columns
    y = (np.arange(rows) + 0.5) * seen.size[1] / rows
    return np.asarray(np.hypot(x[None, :] - circle.x, y[:, None] - circle.y) < circle.radius)
