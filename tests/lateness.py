"""What a busy machine makes any thread wait, so that it is not taken for a gap between pictures."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from itertools import pairwise
from typing import Self

TICK_S = 0.01


class Lateness:
    """A thread that does nothing but look at the clock, and notes when it was not let run. Used by `with`."""

    def __init__(self) -> None:
        self._late: list[tuple[float, float]] = []
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._measure, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self._thread.join()

    def unexplained_s(self, begin: float, end: float) -> float:
        """The time between two moments, in monotonic seconds, but for what this thread had to wait in it."""
        waited = (min(until, end) - max(since, begin) for since, until in list(self._late))
        return end - begin - sum(seconds for seconds in waited if seconds > 0)

    def longest_gap_s(self, times: Iterable[float]) -> float:
        """The longest time between two moments that follow each other, but for what this thread had to wait in it."""
        return max(self.unexplained_s(*pair) for pair in pairwise(times))

    def _measure(self) -> None:
        before = time.monotonic()
        while not self._closing.wait(TICK_S):
            now = time.monotonic()
            if now - before > 2 * TICK_S:
                self._late.append((before + TICK_S, now))
            before = now
