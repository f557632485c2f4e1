"""A slot that holds the newest value of a stream, between the thread that produces values and those that read them."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock

T = TypeVar("T")


class NewestSlot(Generic[T]):
    """Holds one value; a newer one replaces it. Putting never waits, so a slow reader never slows the writer.

    Every value has a number, counted from 1 in the order of putting. Any number of threads may put and read.
    """

    def __init__(self, clock: Clock = SYSTEM_CLOCK) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._value: T | None = None
        self._number = 0
        self._put_at = 0.0
        self._closed = False

    def put(self, value: T) -> None:
        """Replace the value and wake all readers. After `close` the value is thrown away."""
        with self._changed:
            if self._closed:
                return
            self._value = value
            self._number += 1
            self._put_at = self._clock.now()
            self._changed.notify_all()

    def newer(self, than: int, timeout_s: float) -> tuple[int, T, float] | None:
        """Give the newest value if its number is above `than`, waiting up to `timeout_s` for one.

        Returns:
            Its number, the value, and the time in seconds on the slot's clock at which it was put; None when time is
            up, or at once when the slot is closed.
        """
        with self._changed:
            self._clock.wait_for(self._changed, lambda: self._number > than or self._closed, timeout_s)
            if self._value is None or self._number <= than:
                return None
            return self._number, self._value, self._put_at

    def reader(self) -> SlotReader[T]:
        """Make a reader that gets each value at most once, beginning with the one that is there now."""
        return SlotReader(self)

    def close(self) -> None:
        """Wake all readers: they still get the last value if they have not seen it, and then no more."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def count(self) -> int:
        """How many values were put so far: the newest one's number."""
        with self._changed:
            return self._number


class SlotReader(Generic[T]):
    """Reads each value of a slot at most once. For use by one thread.

    Attributes:
        dropped: how many values were replaced before this reader got them.
        put_at: time in seconds on the slot's clock at which the value last got was put.
    """

    def __init__(self, slot: NewestSlot[T]) -> None:
        self._slot = slot
        self._seen = max(0, slot.count - 1)
        self.dropped = 0
        self.put_at = 0.0

    def get(self, timeout_s: float) -> T | None:
        """Get the newest value not seen yet, waiting up to `timeout_s` for one; None if none came."""
        found = self._slot.newer(self._seen, timeout_s)
        if found is None:
            return None
        number, value, self.put_at = found
        self.dropped += number - self._seen - 1
        self._seen = number
        return value
