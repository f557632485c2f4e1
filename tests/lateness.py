"""What a busy machine makes any thread wait, so that it is not taken for a gap between pictures."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Self

import psutil

TICK_S = 0.01


class Lateness:
    """A thread that does nothing but look at the clock, and notes when it was not let run. Used by `with`."""

    def __init__(self) -> None:
        self._late: list[tuple[float, float]] = []
        self._looked_at = 0.0
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
        while self._thread.is_alive() and self._looked_at < end:
            time.sleep(TICK_S)  # both threads may have waited, and this one may be let run first
        waited = (min(until, end) - max(since, begin) for since, until in list(self._late))
        return end - begin - sum(seconds for seconds in waited if seconds > 0)

    def longest_gap_s(self, times: Iterable[float]) -> float:
        """The longest time between two moments that follow each other, but for what this thread had to wait in it."""
        return max(self.unexplained_s(*pair) for pair in pairwise(times))

    def _measure(self) -> None:
        before, closes = time.monotonic(), False
        while not closes:
            closes = self._closing.wait(TICK_S)
            now = time.monotonic()
            if now - before > 2 * TICK_S:
                self._late.append((before + TICK_S, now))
            self._looked_at = before = now


@contextmanager
def spinning() -> Iterator[Callable[[], float]]:
    """A function that tells the processor time, in seconds, that a process which only computes has got so far.

    So long would take, with a core of its own, what takes from one call to the next: a bound in it holds for work that
    needs the processor itself on a busy machine too.
    """
    process = psutil.Popen([sys.executable, "-c", "while True: pass"], stdin=subprocess.DEVNULL)
    try:
        yield lambda: sum(process.cpu_times()[:2])
    finally:
        process.kill()
        process.wait()
