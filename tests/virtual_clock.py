"""A clock for tests: a discrete-event simulation in one thread, in which an hour passes in no time."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Callable


class VirtualClock:
    """Implements `base.concurrency.clock.Clock`. Time passes only while somebody waits, in the thread that waits.

    What happens meanwhile is scheduled beforehand by `at`, or by actions that were. So the code under test runs in the
    test's own thread, and every run is the same.
    """

    def __init__(self, start: float = 1000.0) -> None:
        self._now = start
        self._scheduled: list[tuple[float, int, Callable[[], object]]] = []
        self._count = itertools.count()

    def now(self) -> float:
        return self._now

    def at(self, delay_s: float, action: Callable[[], object]) -> None:
        """Call `action` once `delay_s` seconds from now, while somebody waits."""
        heapq.heappush(self._scheduled, (self._now + delay_s, next(self._count), action))

    def every(self, period_s: float, action: Callable[[], object]) -> None:
        """Call `action` each `period_s` seconds, for ever."""

        def again() -> None:
            action()
            self.at(period_s, again)

        self.at(period_s, again)

    def sleep(self, seconds: float) -> None:
        """Let time pass, as work that takes so long does."""
        self._pass(seconds, lambda: False)

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        return self._pass(timeout_s, event.is_set)

    def wait_for(self, condition: threading.Condition, predicate: Callable[[], bool], timeout_s: float) -> bool:
        return self._pass(timeout_s, predicate)

    def _pass(self, seconds: float, done: Callable[[], bool]) -> bool:
        until = self._now + max(0.0, seconds)
        while not done():
            if not self._scheduled or self._scheduled[0][0] > until:
                self._now = max(self._now, until)
                return done()
            due, _, action = heapq.heappop(self._scheduled)
            self._now = max(self._now, due)
            action()
        return True
