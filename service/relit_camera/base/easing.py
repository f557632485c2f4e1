"""How what changes is eased over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def ease_out_cubic(elapsed_s: float, transition_s: float) -> float:
    """How much of a change is there, 0..1: fast at first, so that it is seen at once, then settling (cubic).

    A change that is begun anew every few milliseconds, as a slider does, is so followed closely. Before its beginning,
    which is where a file that starts again sets its clock, a change is over.
    """
    if not 0 <= elapsed_s < transition_s:
        return 1.0
    return 1 - (1 - elapsed_s / transition_s) ** 3


def interpolate_keyframes(at: float, keys: Sequence[tuple[float, float]]) -> float:
    """The value between keys (place, value) of rising places, eased in and out of each (Hermite)."""
    places, values = np.array(keys).T
    after = int(np.clip(np.searchsorted(places, at, side="right"), 1, len(keys) - 1))
    share = np.clip((at - places[after - 1]) / (places[after] - places[after - 1]), 0, 1)
    eased = share**2 * (3 - 2 * share)
    return float(values[after - 1] + (values[after] - values[after - 1]) * eased)
