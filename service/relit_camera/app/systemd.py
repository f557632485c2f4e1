"""Tells systemd how the camera does: ready, alive, stopping (`Type=notify`, sd_notify(3)).

The protocol is one datagram of text. It is written here because the one package for it in plain Python (sdnotify) has
had no release since 2017, and the others (cysystemd, systemd-python) bind libsystemd, a compiled part for a few lines.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from relit_camera.live.status.camera_status import CameraStatus

log = logging.getLogger(__name__)

SINK_FAILED = "sink failed"
"""What the status says while the sink takes no pictures and is tried again."""
FIRST_PICTURE_POLL_S = 0.05
STATUS_INTERVAL_S = 5.0
"""How often the status line is renewed where no watchdog asks for more."""


class SystemdNotifier:
    """The service manager that started this process."""

    def __init__(self, address: str, watchdog_s: float | None = None) -> None:
        """Set up.

        Args:
            address: of its socket: a path, or `@` and an abstract name.
            watchdog_s: it ends a service that gives no sign of life for so many seconds; None where it does not watch.
        """
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self.watchdog_s = watchdog_s

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> SystemdNotifier | None:
        """The one that the environment names; None where this process is no service of systemd's."""
        address = environment.get("NOTIFY_SOCKET", "")
        if not address.startswith(("/", "@")):
            return None
        microseconds = environment.get("WATCHDOG_USEC", "")
        meant_for = environment.get("WATCHDOG_PID", str(os.getpid()))
        watched = microseconds.isdigit() and int(microseconds) > 0 and meant_for == str(os.getpid())
        return cls(address, int(microseconds) / 1e6 if watched else None)

    def notify(self, *lines: str) -> None:
        """Send assignments such as `READY=1`. A manager that does not listen changes nothing for the camera."""
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as channel:
                channel.connect(self._address)
                channel.sendall("\n".join(lines).encode())
        except OSError as error:
            log.warning("the service manager cannot be told %s: %s", lines[0], error)


@contextmanager
def notify_systemd(status: Callable[[], CameraStatus], manager: SystemdNotifier | None = None) -> Iterator[None]:
    """While the context lasts, tell the service manager, if there is one, how the camera does.

    READY=1 when the first picture was published, then WATCHDOG=1 at half the watchdog's time, though only if pictures
    went out since the last one, or the status says that the sink takes none: a camera that stands still is to be
    started anew, not one that knows what is wrong and tries again. STOPPING=1 at the end.
    """
    manager = manager or SystemdNotifier.from_environment()
    if manager is None:
        yield
        return
    over = threading.Event()
    thread = threading.Thread(target=_report, args=(manager, status, over), name="service-manager", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(1.0)
        manager.notify("STOPPING=1", "STATUS=stopping")


def _report(manager: SystemdNotifier, status: Callable[[], CameraStatus], over: threading.Event) -> None:
    while status().frames.published == 0:
        if over.wait(FIRST_PICTURE_POLL_S):
            return
    now = status()
    manager.notify("READY=1", f"STATUS={status_line(now)}")
    published = now.frames.published
    while not over.wait(STATUS_INTERVAL_S if manager.watchdog_s is None else manager.watchdog_s / 2):
        now = status()
        alive = ["WATCHDOG=1"] if now.frames.published > published or _sink_failed(now) else []
        published = now.frames.published
        manager.notify(*alive, f"STATUS={status_line(now)}")


def _sink_failed(status: CameraStatus) -> bool:
    return any(trouble.what == SINK_FAILED for trouble in status.degraded)


def status_line(status: CameraStatus) -> str:
    """One line for `systemctl status`: state, source, sink, and the first trouble."""
    trouble = f"; {status.degraded[0].what}: {status.degraded[0].why}" if status.degraded else ""
    return f"{status.state}: {status.source} to {status.sink}{trouble}".replace("\n", " ")
