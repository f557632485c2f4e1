"""GStreamer as the reader in a call: what it got, and when."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.pipewire.pattern_camera import PLACEHOLDER
from tests.pipewire.session import Session, wait_for
from tests.pipewire.test_pipewire_camera import LABEL, SIZE, worst_of
from tests.vm.guest.pattern_number import read_number

TICK_S = 0.01
KEPT_BYTES = 64 << 20
"""Of the newest pictures that a reader keeps: two seconds of 1280x720, 26 of 320x180."""


@dataclass(frozen=True)
class Gap:
    """The time between two pictures.

    Attributes:
        seconds: as they came.
        late_s: the longest time in it for which this process, which does nothing but look at the clock, was not let
            run: what a busy machine makes any process wait.
    """

    seconds: float
    late_s: float


@dataclass(frozen=True)
class Seen:
    """A picture that a reader got.

    Attributes:
        planes: I420.
        width: in pixels.
    """

    planes: bytes
    width: int

    @cached_property
    def image(self) -> NDArray[np.uint8]:
        """In RGB."""
        planes = np.frombuffer(self.planes, np.uint8).reshape(-1, self.width)
        return np.asarray(cv2.cvtColor(planes, cv2.COLOR_YUV2RGB_I420), np.uint8)

    @cached_property
    def number(self) -> int | None:
        """Of the pattern; None of the placeholder."""
        return read_number(self.image)

    @property
    def worst(self) -> int:
        """How far its colours are off."""
        if self.number is None:
            return int(abs(self.image.astype(int) - PLACEHOLDER).max())
        return worst_of(self.image)


class Reader:
    """GStreamer in a call. Its pictures are looked at later, for it waits while nobody takes them.

    Attributes:
        times: when each picture came, in monotonic seconds.
        seen: the newest of them.
    """

    def __init__(self, session: Session, size: tuple[int, int] = SIZE) -> None:
        source = ["pipewiresrc", f"target-object={LABEL}", "!", "video/x-raw,format=I420", "!"]
        self.process = session.spawn("gst-launch-1.0", "-q", *source, "fdsink", "fd=1", "sync=false")
        self._size = size
        self.times: list[float] = []
        self.seen: deque[Seen] = deque(maxlen=KEPT_BYTES // (size[0] * size[1] * 3 // 2))
        self._late: list[tuple[float, float]] = []
        """Beginning and end of the times for which this process was not let run."""
        self._closing = threading.Event()
        self._threads = [threading.Thread(target=target) for target in (self._read, self._measure_lateness)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End it."""
        self._closing.set()
        self.process.kill()
        for thread in self._threads:
            thread.join()
        self.process.communicate()

    @property
    def goes_on(self) -> bool:
        """Whether the call has not ended."""
        return self.process.poll() is None

    @property
    def has_all(self) -> bool:
        """Whether all pictures that came are kept."""
        return len(self.times) <= (self.seen.maxlen or 0)

    def wait_for_pictures(self, count: int = 20) -> None:
        """Wait until so many more have come."""
        wanted = len(self.times) + count
        wait_for(lambda: len(self.times) >= wanted, f"{count} pictures")

    def wait_for_another(self, than: int | None) -> None:
        """Wait until a picture with another number comes: from a camera."""
        wait_for(lambda: self.seen[-1].number not in (than, None), "a camera")

    def longest_gap(self) -> Gap:
        """The longest time between two pictures."""
        begin, end = max(pairwise(list(self.times)), key=lambda pair: pair[1] - pair[0])
        late = [min(until, end) - max(since, begin) for since, until in list(self._late)]
        return Gap(end - begin, max([0.0, *late]))

    def _read(self) -> None:
        assert self.process.stdout is not None
        width, height = self._size
        count = width * height * 3 // 2
        while len(planes := self.process.stdout.read(count)) == count:
            self.times.append(time.monotonic())
            self.seen.append(Seen(planes, width))

    def _measure_lateness(self) -> None:
        before = time.monotonic()
        while not self._closing.wait(TICK_S):
            now = time.monotonic()
            if now - before > 2 * TICK_S:
                self._late.append((before + TICK_S, now))
            before = now
