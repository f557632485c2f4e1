"""The clock that threads wait on: the system's own, or in tests one whose time passes only as the test says."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol


class Clock(Protocol):
    """Monotonic time, and waiting that takes up such time.

    Whatever waits or measures while the camera runs takes a clock, so that its tests need not sleep.
    """

    def now(self) -> float:
        """Seconds since an arbitrary moment; never goes back."""
        ...

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        """Wait for `event` up to `timeout_s` seconds. Returns whether it is set."""
        ...

    def wait_for(self, condition: threading.Condition, predicate: Callable[[], bool], timeout_s: float) -> bool:
        """Wait up to `timeout_s` seconds until `predicate` holds. Returns whether it does.

        The caller holds `condition`, which is notified whenever the predicate may have changed.
        """
        ...


class SystemClock:
    """`time.monotonic` and the waiting of the threading module."""

    def now(self) -> float:
        """`time.monotonic()`."""
        return time.monotonic()

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        """`event.wait`."""
        return event.wait(timeout_s)

    def wait_for(self, condition: threading.Condition, predicate: Callable[[], bool], timeout_s: float) -> bool:
        """`condition.wait_for`."""
        return condition.wait_for(predicate, timeout_s)


SYSTEM_CLOCK = SystemClock()
