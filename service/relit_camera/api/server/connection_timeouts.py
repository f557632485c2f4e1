"""Timeouts for clients that send no request, an incomplete one, or read nothing of the answer.

uvicorn waits for such clients for ever, and each holds an open file and memory. It has no setting for this, so its
protocol class is extended here. That class is not public: pyproject.toml holds uvicorn to one series, and
tests/api/test_api_uvicorn.py checks what is used of it.
"""

from __future__ import annotations

import asyncio
from enum import Enum, auto

from uvicorn.protocols.http.h11_impl import H11Protocol

from relit_camera.api.middleware.body_limits import STREAMED_FORMS

WRITE_TIMEOUT_S = 10.0
"""A client that reads nothing of what is waiting for it is disconnected after this long."""
READ_TIMEOUT_S = 10.0
"""A client that has not sent a complete request, the first or a further one, is disconnected after this long. A body
may take as long for each `MIN_BODY_BYTES_PER_TIMEOUT`."""
MIN_BODY_BYTES_PER_TIMEOUT = 16 << 10

MAX_UNREAD_BODY_BYTES = 128 << 20
"""Of a body that was answered before its end, so much is read and forgotten: most clients send all of it before they
read the answer."""
UNREAD_FORM_S = 10.0
"""Of a form that may be larger, all that it may have is read and forgotten for this long."""


class AwaitedInput(Enum):
    """What the client has to send next."""

    REQUEST = auto()
    BODY = auto()


class TimeoutHttpProtocol(H11Protocol):
    """uvicorn's HTTP/1.1 connection to one client, with timeouts for reading and writing."""

    _read_timer: asyncio.TimerHandle | None = None
    _write_timer: asyncio.TimerHandle | None = None
    _awaited: AwaitedInput | None = None
    _unread_since = 0.0
    _received = _unsent = _unread = 0
    """Bytes received since the read timer was started, bytes that the client had not read when it was, and bytes
    received of a body after its answer."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the read timer for the first request."""
        super().connection_made(transport)
        self._update_read_timer()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the timers."""
        for timer in (self._read_timer, self._write_timer):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what the client sent, and stop the read timer if that completes the request or its body."""
        self._received += len(data)
        if self.cycle is not None and self.cycle.response_complete and self.cycle.more_body:
            self._unread_since = self._unread_since if self._unread else self.loop.time()
            self._unread += len(data)
            if self._unread > self._most_unread():
                self.transport.abort()
                return
        else:
            self._unread = 0
        super().data_received(data)
        self._update_read_timer()

    def _most_unread(self) -> int:
        """Bytes of the body that may come now, after its answer."""
        in_time = self.loop.time() < self._unread_since + UNREAD_FORM_S
        of_form = STREAMED_FORMS.get(self.cycle.scope["path"], 0) if in_time else 0
        return max(MAX_UNREAD_BODY_BYTES, of_form)

    def on_response_complete(self) -> None:
        """Start the read timer for the next request."""
        super().on_response_complete()
        self._update_read_timer()

    def pause_writing(self) -> None:
        """Start the write timer: more is waiting for the client than it reads."""
        super().pause_writing()
        self._write_timer = self.loop.call_later(WRITE_TIMEOUT_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Stop the write timer: the client reads again."""
        if self._write_timer is not None:
            self._write_timer.cancel()
        super().resume_writing()

    def _update_read_timer(self) -> None:
        """Start the timer for what the client has to send now; it runs on while that is the same."""
        awaited = self._awaited_input()
        if awaited is self._awaited:
            return
        self._awaited = awaited
        if self._read_timer is not None:
            self._read_timer.cancel()
        if awaited is not None:
            self._start_timer()

    def _awaited_input(self) -> AwaitedInput | None:
        if self.cycle is None or self.cycle.response_complete:
            return AwaitedInput.REQUEST
        return AwaitedInput.BODY if self.cycle.more_body else None

    def _start_timer(self) -> None:
        self._received, self._unsent = 0, self.transport.get_write_buffer_size()
        self._read_timer = self.loop.call_later(READ_TIMEOUT_S, self._on_read_timeout)

    def _on_read_timeout(self) -> None:
        still_reads = self.transport.get_write_buffer_size() < self._unsent  # the last answer, before its next request
        still_sends = self._awaited is AwaitedInput.BODY and (
            self._received >= MIN_BODY_BYTES_PER_TIMEOUT or self.flow.read_paused
        )
        if still_reads or still_sends:
            self._start_timer()
        else:
            self.transport.abort()
