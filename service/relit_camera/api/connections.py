"""Connections that nobody uses are cut off, so that their files and memory come back.

uvicorn waits for ever for a client that has connected and asks nothing, and for one that takes no more of an answer.
"""

from __future__ import annotations

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

STALLED_S = 10.0
"""A client that takes nothing of what waits for it for so long is gone, or means no good."""
SILENT_S = 10.0
"""The same for one that has connected and not asked a whole question."""
SEND_BUFFER = 256 << 10
"""Bytes that the system keeps for a client: enough for a picture or two. Left alone it would keep some megabytes for
each that does not read, and show slow ones what was seconds ago."""


class TimedConnection(H11Protocol):
    """One client's connection, with an end to waiting."""

    _silent: asyncio.TimerHandle | None = None
    _stalled: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first question."""
        super().connection_made(transport)
        self._silent = self.loop.call_later(SILENT_S, self._end_silent)

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait for nothing more."""
        for timer in (self._silent, self._stalled):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """More waits for the client than it takes: it has until `STALLED_S`."""
        super().pause_writing()
        self._stalled = self.loop.call_later(STALLED_S, self.transport.abort)

    def resume_writing(self) -> None:
        """It takes again."""
        if self._stalled is not None:
            self._stalled.cancel()
        super().resume_writing()

    def _end_silent(self) -> None:
        if self.cycle is None:
            self.transport.abort()
