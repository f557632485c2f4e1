"""Easing curves: a cubic ease-out over time, the smoothstep between two values, and eased keyframes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floating = TypeVar("Floating", bound=np.floating)


def ease_out_cubic(elapsed_s: float, transition_s: float) -> float:
    """Share 0..1 of a change that is reached after `elapsed_s` of `transition_s` seconds: fast at first, then settling.

    A change that restarts every few milliseconds, as while a slider is dragged, is so followed closely. A negative
    `elapsed_s` (the clock of a file that starts again) counts as the end of the change: 1.
    """
    if not 0 <= elapsed_s < transition_s:
        return 1.0
    return 1 - (1 - elapsed_s / transition_s) ** 3


@overload
def smoothstep(value: NDArray[Floating], low: float = ..., high: float = ...) -> NDArray[Floating]: ...


@overload
def smoothstep(value: ArrayLike, low: float = ..., high: float = ...) -> NDArray[Any]: ...


def smoothstep(value: ArrayLike, low: float = 0.0, high: float = 1.0) -> NDArray[Any]:
    """Hermite interpolation 3t² − 2t³ with t = (value − low) / (high − low), clamped to 0..1.

    Elementwise, in the precision of `value`. With `low` above `high` the curve falls instead of rising.
    """
    fraction = np.clip((np.asarray(value) - low) / (high - low), 0, 1)
    return np.asarray(fraction * fraction * (3 - 2 * fraction))


def interpolate_keyframes(position: float, keys: Sequence[tuple[float, float]]) -> float:
    """The value at `position` between keys (position, value) of rising positions, by `smoothstep` between neighbours.

    Before the first key and after the last their values hold.
    """
    positions, values = np.array(keys).T
    after = int(np.clip(np.searchsorted(positions, position, side="right"), 1, len(keys) - 1))
    fraction = smoothstep(position, positions[after - 1], positions[after])
    return float(values[after - 1] + (values[after] - values[after - 1]) * fraction)
