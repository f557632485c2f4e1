"""Runs the web application in a thread, on a socket that is bound before anything else of the camera starts."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

import uvicorn
from fastapi import FastAPI
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relit_camera.api.problem_details import problem_response_from
from relit_camera.api.server.connection_timeouts import TimeoutHttpProtocol
from relit_camera.api.server.listener import open_listener
from relit_camera.base.concurrency.decoding_process import DECODING_PROCESS
from relit_camera.base.config.settings import ServerSettings
from relit_camera.base.errors import NotReadyError, RelitError

START_TIMEOUT_S = 10.0
SHUTDOWN_GRACE_S = 1
"""When the server stops, answers may take this long to end before they are aborted."""

MALFORMED_REQUEST = "Invalid HTTP request received."
"""What uvicorn logs of a request that is no HTTP."""
MALFORMED_INTERVAL_S = 10.0
"""Between two such lines of the log."""


class MalformedRequestFilter(logging.Filter):
    """Lets a line on a malformed request pass if none has for a while, with how many were left out meanwhile."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now = now
        self._last_s: float | None = None
        self._left_out = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the record is written."""
        if record.msg != MALFORMED_REQUEST:
            return True
        now = self._now()
        if self._last_s is not None and now - self._last_s < MALFORMED_INTERVAL_S:
            self._left_out += 1
            return False
        if self._left_out:
            record.msg = f"{MALFORMED_REQUEST} ({self._left_out} more since the last such line)"
        self._last_s, self._left_out = now, 0
        return True


_MALFORMED_REQUESTS = MalformedRequestFilter()


@dataclass(frozen=True)
class ServerAddress:
    """Host and port at which the server listens."""

    host: str
    port: int

    @property
    def url(self) -> str:
        """The panel's address."""
        return f"http://[{self.host}]:{self.port}/" if ":" in self.host else f"http://{self.host}:{self.port}/"


class ApiServer:
    """A server that runs until `stop`, or until the `with` block ends."""

    def __init__(self, app: FastAPI, listener: socket.socket) -> None:
        host, port = listener.getsockname()[:2]
        self.address = ServerAddress(host, port)
        self._closing: threading.Event = app.state.context.closing
        config = uvicorn.Config(
            _ShutdownResponder(app, self._closing),
            http=TimeoutHttpProtocol,
            log_config=None,
            access_log=False,
            lifespan="off",
            ws="none",
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=SHUTDOWN_GRACE_S,
        )
        self._server = uvicorn.Server(config)
        logging.getLogger("uvicorn.error").addFilter(_MALFORMED_REQUESTS)
        # Outside the main thread uvicorn handles no signals. It is no daemon thread, nor are the workers that it
        # starts: at exit Python would stop those inside C++ code, which aborts the process.
        self._thread = threading.Thread(target=self._server.run, args=([listener],), name="api")

    def start(self) -> None:
        """Start the server; returns when it answers.

        Raises:
            RelitError: it did not start within ten seconds.
        """
        self._thread.start()
        deadline = time.monotonic() + START_TIMEOUT_S
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > deadline:
                self.stop()  # otherwise its thread keeps the process from ending
                raise RelitError(f"the server at {self.address.url} did not start", "see the log")
            time.sleep(0.01)

    def stop(self, timeout_s: float = 2.0) -> None:
        """Stop: endless answers end at once, others get a second. Returns when all have ended, or after the timeout."""
        self._closing.set()
        self._server.should_exit = True
        DECODING_PROCESS.interrupt()  # an upload would be waited for
        self._thread.join(timeout_s)

    def __enter__(self) -> ApiServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.stop()


class _ShutdownResponder:
    """ASGI wrapper by which a request aborted by the shutdown is answered by 503, instead of a traceback in the log."""

    def __init__(self, app: ASGIApp, closing: threading.Event) -> None:
        self.app = app
        self.closing = closing

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        started = False

        async def send_watched(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            await self.app(scope, receive, send_watched)
        except asyncio.CancelledError:
            if not self.closing.is_set():
                raise
            if not started:
                await problem_response_from(NotReadyError("the camera is stopping", "start it again"))(
                    scope, receive, send
                )


def start_api_server(app: FastAPI, settings: ServerSettings, listener: socket.socket | None = None) -> ApiServer:
    """Run the application of `create_app` in a thread; returns when it answers.

    Args:
        app: from `create_app`.
        settings: host and port, used where no listener is given.
        listener: from `open_listener`, for callers that bind the address before they start other things.

    Raises:
        PortInUseError, ConfigError: as `open_listener`.
    """
    server = ApiServer(app, listener or open_listener(settings))
    server.start()
    return server
