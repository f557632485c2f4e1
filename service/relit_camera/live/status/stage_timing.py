"""Clocks of the live path: how long each stage takes, how many frames pass, and when the next one is due."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from relit_camera.live.status.camera_status import Percentiles

WINDOW_LENGTH = 300
"""Durations kept for a median: ten seconds at 30 frames a second."""


class DurationWindow:
    """The last durations of one kind. Thread-safe."""

    def __init__(self, length: int = WINDOW_LENGTH) -> None:
        self._seconds: deque[float] = deque(maxlen=length)
        self._lock = threading.Lock()

    def add(self, seconds: float) -> None:
        """Remember one duration, forgetting the oldest."""
        with self._lock:
            self._seconds.append(seconds)

    def percentiles(self) -> Percentiles:
        """Median and 95th percentile in milliseconds, 0 before the first duration."""
        with self._lock:
            seconds = np.array(self._seconds)
        if seconds.size == 0:
            return Percentiles(0.0, 0.0)
        p50, p95 = np.percentile(seconds, [50, 95]) * 1e3
        return Percentiles(float(p50), float(p95))


class StageTimer:
    """Durations of named stages. Thread-safe.

    with timer.stage("track"):
        state = tracker.track(frame)
    """

    def __init__(self, length: int = WINDOW_LENGTH) -> None:
        self._length = length
        self._windows: dict[str, DurationWindow] = {}
        self._lap: dict[str, float] = {}
        self._running: list[str] = []
        self._lock = threading.Lock()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the body of a with-statement; a body that raises is not counted."""
        start = time.perf_counter()
        self._running.append(name)
        try:
            yield
        finally:
            self._running.remove(name)
        self.add(name, time.perf_counter() - start)

    def running(self) -> list[str]:
        """The stages that have begun and not ended, in the order they began."""
        return list(self._running)

    def add(self, name: str, seconds: float) -> None:
        """Count a duration that was measured elsewhere."""
        with self._lock:
            window = self._windows.setdefault(name, DurationWindow(self._length))
            self._lap[name] = seconds * 1e3
        window.add(seconds)

    def percentiles(self) -> dict[str, Percentiles]:
        """Median and 95th percentile of every stage in milliseconds, in the order the stages were first timed."""
        return {name: window.percentiles() for name, window in self._copy().items()}

    def lap_ms(self) -> dict[str, float]:
        """Give the milliseconds of the stages that ran since this was last asked."""
        with self._lock:
            lap, self._lap = self._lap, {}
        return lap

    def _copy(self) -> dict[str, DurationWindow]:
        with self._lock:
            return dict(self._windows)


class RateMeter:
    """Events a second over the last few seconds; falls to 0 when nothing comes. Thread-safe."""

    def __init__(self, window_s: float = 3.0) -> None:
        self._window_s = window_s
        self._total = 0
        self._ticks: deque[tuple[float, int]] = deque(maxlen=4096)
        self._lock = threading.Lock()

    def tick(self, now: float | None = None, events: int = 1) -> None:
        """Count `events` since the last tick, the newest of them at monotonic time `now`."""
        with self._lock:
            self._total += events
            self._ticks.append((time.monotonic() if now is None else now, self._total))

    def rate(self, now: float | None = None) -> float:
        """Events a second at monotonic time `now`, 0 for fewer than two ticks in the window."""
        now = time.monotonic() if now is None else now
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


class Pacer:
    """Deadlines at a frame rate, by arithmetic on one monotonic clock, so that they do not drift.

    A picture that is ready waits for the next deadline, up to a whole period. When pictures come at about the frame
    rate, the deadlines are moved by at most 1 % of a period a frame, until pictures are ready a tenth of a period ahead
    of them: latency falls, and the time between frames stays even. Pictures of any other rate come at all phases and
    move the deadlines to and fro, by nothing on average.
    """

    MARGIN = 0.1
    NUDGE = 0.01
    LATE = 3.0

    def __init__(self, fps: float, now: float) -> None:
        self.period = 1.0 / fps
        self.deadline = now

    def advance(self, now: float, waited_s: float | None = None) -> None:
        """Set the next deadline; after a hiccup of several periods begin anew at `now` instead of catching up.

        Args:
            now: monotonic time in seconds.
            waited_s: how long the picture just shown had been ready; None if nothing new was shown.
        """
        self.deadline += self.period
        if waited_s is not None:
            half = self.period / 2
            ahead = (waited_s - self.MARGIN * self.period + half) % self.period - half
            limit = self.NUDGE * self.period
            self.deadline -= min(max(ahead, -limit), limit)
        if now - self.deadline > self.LATE * self.period:
            self.deadline = now + self.period
