"""Bright and dark frames by the recipe of thesis 4.3.2, for comparison: it wants 30 frames a second and 5 flashes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.flash.kind import Kind

Floats = NDArray[np.float64]

WEAKEST = 0.3
"""Least change from dark to bright as a share of the usual one; the thesis gives no figure."""
FARTHEST = 5
"""Frames between a bright frame and the dark one before or after it: more are an error of the recording."""


def thesis_kinds(level: Floats) -> list[Kind]:
    """Kinds of frames by their mean brightness (frames,): extremes of three are bright and dark, all others partial.

    Neighbouring extremes between which the brightness changes too little, or that lie too far apart, are rejected.
    """
    kinds = [Kind.PARTIAL] * len(level)
    before, middle, after = level[:-2], level[1:-1], level[2:]
    highest, lowest = (middle > before) & (middle >= after), (middle < before) & (middle <= after)
    extremes = np.flatnonzero(highest | lowest) + 1
    for index in extremes:
        kinds[index] = Kind.BRIGHT if highest[index - 1] else Kind.DARK
    change = np.abs(np.diff(level[extremes]))
    usual = float(np.median(change)) if len(change) else 0.0
    for place, (one, other) in enumerate(pairwise(extremes)):
        if change[place] < WEAKEST * usual or other - one > FARTHEST:
            kinds[one] = kinds[other] = Kind.REJECTED
    return kinds
