"""How long each stage of the live pipeline takes, and how many frames a second pass."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.live.status.camera_status import Percentiles

WINDOW_LENGTH = 300
"""Durations kept for a median: ten seconds at 30 frames a second."""


class DurationWindow:
    """The most recent durations of one stage. Thread-safe."""

    def __init__(self, length: int = WINDOW_LENGTH) -> None:
        self._seconds: deque[float] = deque(maxlen=length)
        self._lock = threading.Lock()

    def add(self, seconds: float) -> None:
        """Add one duration; the oldest is dropped when the window is full."""
        with self._lock:
            self._seconds.append(seconds)

    def percentiles(self) -> Percentiles:
        """Median, 95th percentile and maximum in milliseconds, 0 before the first duration."""
        with self._lock:
            seconds = np.array(self._seconds)
        if seconds.size == 0:
            return Percentiles(0.0, 0.0, 0.0)
        p50, p95, longest = np.percentile(seconds, [50, 95, 100]) * 1e3
        return Percentiles(float(p50), float(p95), float(longest))


class StageTimer:
    """Durations of named stages. Thread-safe.

    with timer.stage("track"):
        state = tracker.track(frame)
    """

    def __init__(
        self,
        length: int = WINDOW_LENGTH,
        now: Callable[[], float] = time.perf_counter,
        processor_now: Callable[[], float] = time.thread_time,
    ) -> None:
        """Set up an empty timer.

        Args:
            length: durations that are kept a stage.
            now: gives the time in seconds.
            processor_now: gives the processor time that the thread has used, in seconds.
        """
        self._length, self._now, self._processor_now = length, now, processor_now
        self._windows: dict[str, DurationWindow] = {}
        self._latest: dict[str, float] = {}
        self._running: list[str] = []
        self._processor_s: dict[str, float] = {}
        self._within = threading.local()
        self._lock = threading.Lock()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the body of a with-statement; of one that raises only the processor time is counted."""
        start, processor_start = self._now(), self._processor_now()
        around_s, self._within.seconds = getattr(self._within, "seconds", 0.0), 0.0
        self._running.append(name)
        try:
            yield
        finally:
            self._running.remove(name)
            used_s = self._processor_now() - processor_start
            own_s, self._within.seconds = used_s - self._within.seconds, around_s + used_s
            with self._lock:
                self._processor_s[name] = self._processor_s.get(name, 0.0) + own_s
        self.add(name, self._now() - start)

    def running(self) -> list[str]:
        """The stages that are running now, in the order in which they began."""
        return list(self._running)

    def add(self, name: str, seconds: float) -> None:
        """Add a duration that was measured elsewhere."""
        with self._lock:
            window = self._windows.setdefault(name, DurationWindow(self._length))
            self._latest[name] = seconds * 1e3
        window.add(seconds)

    def processor_s(self) -> dict[str, float]:
        """Processor seconds that each stage has used in its thread so far, without those of stages within it."""
        with self._lock:
            return dict(self._processor_s)

    def percentiles(self) -> dict[str, Percentiles]:
        """Median and 95th percentile of every stage in milliseconds, in the order the stages were first timed."""
        return {name: window.percentiles() for name, window in self._copy().items()}

    def lap_ms(self) -> dict[str, float]:
        """The last duration, in milliseconds, of each stage that ran since the previous call."""
        with self._lock:
            latest, self._latest = self._latest, {}
        return latest

    def _copy(self) -> dict[str, DurationWindow]:
        with self._lock:
            return dict(self._windows)


class RateMeter:
    """Events a second over the last few seconds; falls to 0 when none come. Thread-safe."""

    def __init__(self, window_s: float = 3.0, clock: Clock = SYSTEM_CLOCK) -> None:
        self._window_s, self._clock = window_s, clock
        self._total = 0
        self._ticks: deque[tuple[float, int]] = deque(maxlen=4096)
        self._lock = threading.Lock()

    def tick(self, now: float | None = None, events: int = 1) -> None:
        """Count `events` since the last tick, the newest of them at `now` seconds on the clock."""
        with self._lock:
            self._total += events
            self._ticks.append((self._clock.now() if now is None else now, self._total))

    def rate(self, now: float | None = None) -> float:
        """Events a second at `now` seconds on the clock, 0 for fewer than two ticks in the window."""
        now = self._clock.now() if now is None else now
        with self._lock:
            while self._ticks and self._ticks[0][0] < now - self._window_s:
                self._ticks.popleft()
            if len(self._ticks) < 2:
                return 0.0
            (first, before), (last, total) = self._ticks[0], self._ticks[-1]
            # Up to `now` once the next tick is overdue, so that the rate falls at once when events stop.
            span = last - first
            overdue = max(0.0, now - last - span / (len(self._ticks) - 1))
            return (total - before) / max(span + overdue, 1e-6)
