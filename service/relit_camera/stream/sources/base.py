"""What every source is: a state machine that hands out frames."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from relit_camera.space.images import Frame


class SourceState(StrEnum):
    """What a source is doing."""

    IDLE = "idle"
    """Made, but not read yet."""
    OPENING = "opening"
    """Opened, no frame yet."""
    RUNNING = "running"
    STALLED = "stalled"
    """Open, but no frame came for longer than its patience."""
    RECONNECTING = "reconnecting"
    """Gone; it is looked for again and again."""
    RELEASED = "released"
    """On demand, and nobody looks: closed until somebody does (`stream.demand`). No single source is ever so."""
    FAILED = "failed"
    """It cannot go on: `read` raises why."""
    ENDED = "ended"
    """It gave its last frame, or was closed."""


_S = SourceState
MOVES: dict[SourceState, frozenset[SourceState]] = {
    _S.IDLE: frozenset({_S.OPENING, _S.ENDED}),
    _S.OPENING: frozenset({_S.RUNNING, _S.RECONNECTING, _S.FAILED, _S.ENDED}),
    _S.RUNNING: frozenset({_S.STALLED, _S.RECONNECTING, _S.FAILED, _S.ENDED}),
    _S.STALLED: frozenset({_S.RUNNING, _S.RECONNECTING, _S.FAILED, _S.ENDED}),
    _S.RECONNECTING: frozenset({_S.OPENING, _S.FAILED, _S.ENDED}),
    _S.FAILED: frozenset({_S.ENDED}),
    _S.ENDED: frozenset(),
}
"""The legal moves. Staying where one is is always legal. No source goes to RELEASED: what wraps it says so."""


class IllegalMoveError(RuntimeError):
    """A source tried a move that is not in the table: a fault of ours."""


class StateMachine:
    """The state of one source. Thread-safe."""

    def __init__(self) -> None:
        self._state = SourceState.IDLE
        self._lock = threading.Lock()

    @property
    def state(self) -> SourceState:
        """The present state."""
        return self._state

    def move(self, to: SourceState, only_from: SourceState | None = None) -> None:
        """Go to another state; with `only_from`, do nothing unless that is the present one.

        Raises:
            IllegalMoveError: the table has no such move.
        """
        with self._lock:
            if self._state is to or (only_from is not None and self._state is not only_from):
                return
            if to not in MOVES[self._state]:
                raise IllegalMoveError(f"a source cannot go from {self._state} to {to}")
            self._state = to


@dataclass(frozen=True)
class SourceInfo:
    """What a source is.

    Attributes:
        kind: webcam, file, still or pattern.
        id: what to give as `--source` to get it again.
        size: width and height in pixels: real once a frame came, what was asked for until then.
        fps: frames a second, likewise.
    """

    kind: str
    id: str
    size: tuple[int, int]
    fps: float


class Source(Protocol):
    """Gives frames to one reading thread. Nothing is opened before the first `read`.

    The newest frame is given, older ones are dropped. Indices count from 0 and grow; they have gaps where frames were
    dropped.
    """

    def read(self, timeout_s: float) -> Frame | None:
        """Get the next frame, waiting up to `timeout_s` seconds; None if none came in time or none will come any more.

        Raises:
            RelitError: the source has failed for good; again at each call. Never for a camera that is away.
        """
        ...

    @property
    def state(self) -> SourceState:
        """What the source is doing."""
        ...

    @property
    def reason(self) -> str:
        """One line saying why no frames come, for people; empty while they do."""
        ...

    def describe(self) -> SourceInfo:
        """Say what the source is."""
        ...

    def close(self) -> None:
        """Free the device or file and end the thread, within 2 s. Harmless when repeated."""
        ...
