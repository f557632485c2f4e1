"""Hands events to listeners, each through a bounded queue: a slow listener loses events and delays nobody."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

QUEUE_LENGTH = 64


@dataclass(frozen=True)
class Event:
    """Something that happened to the camera.

    Attributes:
        kind: `state`, `tracking`, `neutral-pose`, `degraded`, `recovered`; `collection` where something is stored,
            renamed or deleted; `capture`, `desk-capture`, `expression-capture`, `film-capture` and `replay` from these
            jobs; `models` and `framing` from the set-up; `caption` from the demonstration's tour.
        data: JSON-ready details.
        at: seconds since the epoch.
    """

    kind: str
    data: Mapping[str, Any]
    at: float = field(default_factory=time.time)


class EventHub:
    """Hands every event to every listener. Any thread may publish; publishing never blocks."""

    def __init__(self) -> None:
        self._listeners: set[queue.Queue[Event]] = set()
        self._lock = threading.Lock()

    def publish(self, kind: str, **data: Any) -> None:
        """Hand an event to all listeners; a listener whose queue is full loses its oldest event."""
        event = Event(kind, data)
        with self._lock:
            for listener in self._listeners:
                while True:
                    try:
                        listener.put_nowait(event)
                        break
                    except queue.Full:
                        listener.get_nowait()

    @contextmanager
    def listen(self) -> Iterator[queue.Queue[Event]]:
        """A queue that receives events while the context lasts."""
        listener: queue.Queue[Event] = queue.Queue(QUEUE_LENGTH)
        with self._lock:
            self._listeners.add(listener)
        try:
            yield listener
        finally:
            with self._lock:
                self._listeners.discard(listener)
