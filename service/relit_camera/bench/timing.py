"""Timing one function."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def median_ms(call: Callable[[], object], repeats: int = 30, at_most_s: float = 5.0) -> float:
    """Median milliseconds of a call after two that are not counted; fewer repeats if they would last too long."""
    call()
    started = time.perf_counter()
    call()
    once = time.perf_counter() - started
    durations = []
    for _ in range(max(3, min(repeats, int(at_most_s / max(once, 1e-9))))):
        started = time.perf_counter()
        call()
        durations.append(time.perf_counter() - started)
    return float(np.median(durations) * 1e3)
