"""The protocol of sources and their states, and the base class of sources that read in a thread of their own."""

from __future__ import annotations

import logging
import threading
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from relit_camera.base.concurrency.newest_slot import NewestSlot
from relit_camera.base.errors import IllegalTransitionError
from relit_camera.base.images.image_types import Frame


class SourceState(StrEnum):
    """The state of a source."""

    IDLE = "idle"
    """Created, but not read yet."""
    OPENING = "opening"
    """Opened, no frame yet."""
    RUNNING = "running"
    STALLED = "stalled"
    """Open, but no frame came within its timeout."""
    RECONNECTING = "reconnecting"
    """The device is away, and is searched for again and again."""
    RELEASED = "released"
    """Closed while nobody reads the output: only the wrapper `devices.on_demand` is ever in this state."""
    FAILED = "failed"
    """It cannot continue: `read` raises the reason."""
    ENDED = "ended"
    """It gave its last frame, or was closed."""


_S = SourceState
TRANSITIONS: dict[SourceState, frozenset[SourceState]] = {
    _S.IDLE: frozenset({_S.OPENING, _S.ENDED}),
    _S.OPENING: frozenset({_S.RUNNING, _S.RECONNECTING, _S.FAILED, _S.ENDED}),
    _S.RUNNING: frozenset({_S.STALLED, _S.RECONNECTING, _S.FAILED, _S.ENDED}),
    _S.STALLED: frozenset({_S.RUNNING, _S.RECONNECTING, _S.FAILED, _S.ENDED}),
    _S.RECONNECTING: frozenset({_S.OPENING, _S.FAILED, _S.ENDED}),
    _S.FAILED: frozenset({_S.ENDED}),
    _S.ENDED: frozenset(),
}
"""The legal transitions. Staying in a state is always legal. No source goes to RELEASED itself."""


class SourceStateMachine:
    """The state of one source. Thread-safe."""

    def __init__(self) -> None:
        self._state = SourceState.IDLE
        self._lock = threading.Lock()

    @property
    def state(self) -> SourceState:
        """The present state."""
        return self._state

    def transition(self, to: SourceState, only_from: SourceState | None = None) -> None:
        """Go to another state; with `only_from`, do nothing unless that is the present one.

        Raises:
            IllegalTransitionError: the transition is not in `TRANSITIONS`.
        """
        with self._lock:
            if self._state is to or (only_from is not None and self._state is not only_from):
                return
            if to not in TRANSITIONS[self._state]:
                raise IllegalTransitionError(f"a source cannot go from {self._state} to {to}")
            self._state = to


@dataclass(frozen=True)
class SourceInfo:
    """Facts about a source.

    Attributes:
        kind: webcam, file, still or pattern.
        id: the value of `--source` that opens it again.
        size: width and height in pixels: those asked for until the first frame, then the real ones.
        fps: frames a second, likewise.
    """

    kind: str
    id: str
    size: tuple[int, int]
    fps: float


class Source(Protocol):
    """Gives live frames to one reading thread. Nothing is opened before the first `read`.

    `read` returns the newest frame; older ones are dropped. Indices count from 0, with gaps where frames were dropped.
    """

    def read(self, timeout_s: float) -> Frame | None:
        """Get the next frame, waiting up to `timeout_s` seconds; None if none came in time or none will come any more.

        Its picture is an array of its own, which the source does not use again: it may be published as it is.

        Raises:
            RelitError: the source has failed for good; raised again at each call. Not for a camera that is away.
        """
        ...

    @property
    def state(self) -> SourceState:
        """The state of the source."""
        ...

    @property
    def reason(self) -> str:
        """One line for people saying why no frames come; empty while they do."""
        ...

    def describe(self) -> SourceInfo:
        """Facts about the source."""
        ...

    def close(self) -> None:
        """Free the device or file and end the thread, within 2 s. Harmless when repeated."""
        ...


log = logging.getLogger(__name__)

JOIN_TIMEOUT_S = 2.0


class ThreadedSource(ABC):
    """Base class of sources whose frames are produced in a thread of their own, started by the first `read`.

    Subclasses implement `_produce`, which calls `_publish` for every frame and returns soon after `_stopping` is set.
    """

    def __init__(self, info: SourceInfo) -> None:
        self._info = info
        self._machine = SourceStateMachine()
        self._stopping = threading.Event()
        self._slot: NewestSlot[Frame] = NewestSlot()
        self._reader = self._slot.reader()
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        self._reason = ""

    def read(self, timeout_s: float) -> Frame | None:
        """Get the newest frame not read yet, waiting up to `timeout_s`; None if none came.

        Raises:
            RelitError: the source has failed for good.
        """
        if self._thread is None and not self._stopping.is_set():
            self._machine.transition(SourceState.OPENING)
            # A daemon thread: a driver that hangs must not keep the program from ending.
            self._thread = threading.Thread(target=self._run, name=f"source-{self._info.kind}", daemon=True)
            self._thread.start()
        frame = self._reader.get(timeout_s)
        if frame is None and self._error is not None:
            raise self._error
        return frame

    @property
    def state(self) -> SourceState:
        """The state of the source."""
        return self._machine.state

    @property
    def reason(self) -> str:
        """One line saying why no frames come; empty while they do."""
        return self._reason

    def describe(self) -> SourceInfo:
        """Facts about the source."""
        return self._info

    def close(self) -> None:
        """End the thread and free the device or file, within 2 s."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(JOIN_TIMEOUT_S)
            if self._thread.is_alive():
                log.warning("%s did not close its device within %.0f s", self._thread.name, JOIN_TIMEOUT_S)
        self._slot.close()
        self._machine.transition(SourceState.ENDED)

    def _run(self) -> None:
        try:
            self._produce()
        except Exception as error:  # handed to the thread that reads
            self._error, self._reason = error, str(error)
            self._machine.transition(SourceState.FAILED)
        else:
            self._machine.transition(SourceState.ENDED)
        finally:
            self._slot.close()

    def _publish(self, frame: Frame) -> None:
        if self._stopping.is_set():
            return
        self._reason = ""
        self._machine.transition(SourceState.RUNNING)
        self._slot.put(frame)  # last: the state is RUNNING when the frame arrives

    @abstractmethod
    def _produce(self) -> None:
        """Produce frames until there are no more or `_stopping` is set."""
