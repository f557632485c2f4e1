"""Connections that nobody uses are cut off, so that their files and memory come back.

uvicorn waits for ever for a client that has connected and asks nothing, for one that does not end what it asks, and
for one that takes no more of an answer.
"""

from __future__ import annotations

import asyncio
from enum import Enum, auto

from uvicorn.protocols.http.h11_impl import H11Protocol

WRITE_TIMEOUT_S = 10.0
"""A client that takes nothing of what waits for it for so long is gone, or means no good."""
READ_TIMEOUT_S = 10.0
"""The same for one that has not asked a whole question, the first or another; a long body has so long for each
`MIN_BODY_BYTES_PER_TIMEOUT`."""
MIN_BODY_BYTES_PER_TIMEOUT = 16 << 10
SEND_BUFFER_BYTES = 256 << 10
"""Bytes that the system keeps for a client: enough for a picture or two. Left alone it would keep some megabytes for
each that does not read, and show slow ones what was seconds ago."""


class AwaitedInput(Enum):
    """What a client has begun or is to begin, and we wait for."""

    REQUEST = auto()
    BODY = auto()


class TimeoutHttpProtocol(H11Protocol):
    """One client's connection, with an end to waiting."""

    _read_timer: asyncio.TimerHandle | None = None
    _write_timer: asyncio.TimerHandle | None = None
    _awaited: AwaitedInput | None = None
    _received = _unsent = 0
    """Bytes received since the timer was started, and what had not been taken from us then."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first question."""
        super().connection_made(transport)
        self._update_read_timer()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait for nothing more."""
        for timer in (self._read_timer, self._write_timer):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """The client said something, which may end the waiting or not."""
        self._received += len(data)
        super().data_received(data)
        self._update_read_timer()

    def on_response_complete(self) -> None:
        """Begin to wait for the next question."""
        super().on_response_complete()
        self._update_read_timer()

    def pause_writing(self) -> None:
        """More waits for the client than it takes: it has until `WRITE_TIMEOUT_S`."""
        super().pause_writing()
        self._write_timer = self.loop.call_later(WRITE_TIMEOUT_S, self.transport.abort)

    def resume_writing(self) -> None:
        """It takes again."""
        if self._write_timer is not None:
            self._write_timer.cancel()
        super().resume_writing()

    def _update_read_timer(self) -> None:
        """Wait for what the client owes now; the time runs on while that is the same."""
        owed = self._awaited_input()
        if owed is self._awaited:
            return
        self._awaited = owed
        if self._read_timer is not None:
            self._read_timer.cancel()
        if owed is not None:
            self._start_timer()

    def _awaited_input(self) -> AwaitedInput | None:
        if self.cycle is None or self.cycle.response_complete:
            return AwaitedInput.REQUEST
        return AwaitedInput.BODY if self.cycle.more_body else None

    def _start_timer(self) -> None:
        self._received, self._unsent = 0, self.transport.get_write_buffer_size()
        self._read_timer = self.loop.call_later(READ_TIMEOUT_S, self._on_read_timeout)

    def _on_read_timeout(self) -> None:
        still_takes = self.transport.get_write_buffer_size() < self._unsent  # the last answer, before it asks again
        still_sends = self._awaited is AwaitedInput.BODY and (
            self._received >= MIN_BODY_BYTES_PER_TIMEOUT or self.flow.read_paused
        )
        if still_takes or still_sends:
            self._start_timer()
        else:
            self.transport.abort()
