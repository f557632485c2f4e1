"""Binds the server's address, before anything else of the camera starts, and without loading the web framework."""

from __future__ import annotations

import errno
import os
import socket

from relit_camera.base.config.access_token import read_token
from relit_camera.base.config.settings import ServerSettings
from relit_camera.base.errors import ConfigError, PortInUseError

LISTEN_BACKLOG = 128
SEND_BUFFER_BYTES = 256 << 10
"""Bytes that the system buffers for a client: enough for a picture or two. By itself it would buffer some megabytes
for each client that does not read, and show slow clients pictures that are seconds old."""


def open_listener(settings: ServerSettings) -> socket.socket:
    """Bind the address, so that no other program can; `start_api_server` answers on it. Port 0 takes any free one.

    Raises:
        PortInUseError: another program listens there.
        ConfigError: the address does not exist on this machine, the port needs rights, or the address can be reached
            from other machines and there is no token (`read_token`).
    """
    read_token(settings)
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    where = f"port {settings.port} on {settings.host}"
    try:
        listener = socket.create_server((settings.host, settings.port), family=family, backlog=LISTEN_BACKLOG)
        # Both are of the connections that it accepts. Without NODELAY the second write of an answer, its body, waits 40
        # ms for the client's acknowledgement of the first; asyncio sets it only where a socket names its protocol.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return listener
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            cure = (
                "another program listens there (an open Relit Camera?): end it, or choose another with --port; "
                + _FREE_PORT_HINT
            )
            raise PortInUseError(f"{where} is in use", cure) from error
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise ConfigError(
            f"{where} cannot be used: {reason}", f"choose another with --host and --port; {_FREE_PORT_HINT}"
        ) from error


_FREE_PORT_HINT = "--port 0 picks a free one"
