"""The lamp's mirror image where it lies on that of another lamp or of a bright window, which is white anyway."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_LEAST_SEEN = 0.5
"""Share of the disc that must lie where the lamp can be told from the rest."""
_MISFIT = 0.35
"""Share of the disc's area on which the picture may differ from it."""
_MARGIN = 2

Plane = NDArray[np.float32]


def covered_disc(lit: NDArray[np.bool_], known: NDArray[np.bool_], area_px: float) -> tuple[float, float] | None:
    """The centre x, y in pixels of the disc that fits best to what is seen of it; None where too little is.

    Least squares over all whole pixels, by correlation, then the top of a parabola.

    Args:
        lit: (height, width) where the lamp shows.
        known: (height, width) where it can be seen whether it does; `lit` elsewhere counts not.
        area_px: of the disc.
    """
    radius = float(np.sqrt(area_px / np.pi))
    reach = int(np.ceil(radius)) + _MARGIN
    if min(lit.shape) <= 2 * reach:
        return None
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.clip(radius + 0.5 - np.hypot(x, y), 0, 1).astype(np.float32)
    shows, tells = (lit & known).astype(np.float32), known.astype(np.float32)
    overlap = _correlated(shows, disc)
    seen = _correlated(tells, disc) / float(disc.sum())
    cost = float(shows.sum()) - 2 * overlap + _correlated(tells, disc**2)
    allowed = np.where(seen >= _LEAST_SEEN, cost, np.float32(np.inf))
    row, column = np.unravel_index(int(np.argmin(allowed)), cost.shape)
    if not allowed[row, column] <= _MISFIT * area_px:
        return None
    down = _top(cost[max(row - 1, 0) : row + 2, column])
    across = _top(cost[row, max(column - 1, 0) : column + 2])
    return float(column + across + 0.5), float(row + down + 0.5)


def _correlated(picture: Plane, disc: Plane) -> Plane:
    return np.asarray(cv2.filter2D(picture, cv2.CV_32F, disc, borderType=cv2.BORDER_CONSTANT))


def _top(costs: Plane) -> float:
    """Where a parabola through three costs is least, beside the middle one; 0 at a border."""
    if len(costs) < 3:
        return 0.0
    before, here, after = costs.astype(float)
    bend = before - 2 * here + after
    return float(np.clip((before - after) / 2 / bend, -0.5, 0.5)) if bend > 0 else 0.0
