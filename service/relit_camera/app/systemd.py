"""Reports to systemd whether the camera is ready, alive or stopping (`Type=notify`, sd_notify(3)); asks if it restarts.

The protocol is one datagram of text. It is written here because the one package for it in plain Python (sdnotify) has
had no release since 2017, and the others (cysystemd, systemd-python) bind libsystemd, a compiled part for a few lines.
"""

from __future__ import annotations

import logging
import os
import re
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.live.status.camera_status import CameraStatus, DegradationCode

log = logging.getLogger(__name__)

FIRST_PICTURE_POLL_S = 0.05
"""How often the status is read until the first picture was published, in seconds."""
JOBS_S = 0.5
"""How long the manager may take to tell its jobs."""
STATUS_INTERVAL_S = 5.0
"""How often the status line is renewed where no watchdog asks for more, in seconds."""


class SystemdNotifier:
    """Sends notifications to the service manager that started this process."""

    def __init__(self, address: str, watchdog_s: float | None = None) -> None:
        """Set up.

        Args:
            address: of the manager's socket: a path, or `@` and an abstract name.
            watchdog_s: the manager restarts a service that sends no `WATCHDOG=1` for so many seconds; None if it does
                not watch.
        """
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self.watchdog_s = watchdog_s

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> SystemdNotifier | None:
        """The notifier for the manager that the environment names; None if systemd did not start this process."""
        address = environment.get("NOTIFY_SOCKET", "")
        if not address.startswith(("/", "@")):
            return None
        microseconds = environment.get("WATCHDOG_USEC", "")
        meant_for = environment.get("WATCHDOG_PID", str(os.getpid()))
        watched = microseconds.isdigit() and int(microseconds) > 0 and meant_for == str(os.getpid())
        return cls(address, int(microseconds) / 1e6 if watched else None)

    def notify(self, *lines: str) -> None:
        """Send assignments such as `READY=1`. When the manager does not listen, that is logged and no error."""
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as channel:
                channel.connect(self._address)
                channel.sendall("\n".join(lines).encode())
        except OSError as error:
            log.warning("the service manager does not take %s: %s", lines[0], error)


@contextmanager
def notify_systemd(status: Callable[[], CameraStatus], manager: SystemdNotifier | None = None) -> Iterator[None]:
    """While the context lasts, report the camera's status to the service manager, if there is one.

    A thread runs `report_until`; at the end `STOPPING=1` is sent.
    """
    manager = manager or SystemdNotifier.from_environment()
    if manager is None:
        yield
        return
    over = threading.Event()
    thread = threading.Thread(target=report_until, args=(over, manager, status), name="service-manager", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(1.0)
        manager.notify("STOPPING=1", "STATUS=stopping")


def report_until(
    over: threading.Event,
    manager: SystemdNotifier,
    status: Callable[[], CameraStatus],
    clock: Clock = SYSTEM_CLOCK,
) -> None:
    """Report the camera's status in the calling thread until `over` is set.

    `READY=1` is sent when the first picture was published, or the status says that the sink fails: the panel then says
    what to do. After that comes `WATCHDOG=1` at half the watchdog's time, but only if
    pictures were published since the last one, or if the status says that the sink fails: a camera that hangs is to be
    restarted, not one that knows what is wrong and tries again.
    """
    while (now := status()).frames.published == 0 and not _sink_failed(now):
        if clock.wait(over, FIRST_PICTURE_POLL_S):
            return
    manager.notify("READY=1", f"STATUS={status_line(now)}")
    published = now.frames.published
    while not clock.wait(over, STATUS_INTERVAL_S if manager.watchdog_s is None else manager.watchdog_s / 2):
        now = status()
        alive = ["WATCHDOG=1"] if now.frames.published > published or _sink_failed(now) else []
        published = now.frames.published
        manager.notify(*alive, f"STATUS={status_line(now)}")


def _sink_failed(status: CameraStatus) -> bool:
    return any(degradation.code is DegradationCode.SINK_FAILED for degradation in status.degraded)


def status_line(status: CameraStatus) -> str:
    """One line for `systemctl status`: state, source, sink, and the first degradation."""
    degraded = f"; {status.degraded[0].what}: {status.degraded[0].why}" if status.degraded else ""
    return f"{status.state}: {status.source} to {status.sink}{degraded}".replace("\n", " ")


def is_being_restarted(cgroup: Path = Path("/proc/self/cgroup"), command: str = "systemctl") -> bool:
    """Whether the service manager stops this process to start it anew, and not to stop it for good.

    The manager tells a service nothing of that: it is asked for its list of jobs. Where it does not answer, this is a
    stop for good.

    Args:
        cgroup: names the unit that this process belongs to (cgroups(7)).
        command: asks the manager.
    """
    if "NOTIFY_SOCKET" not in os.environ:
        return False  # it has not started this process
    try:
        groups = cgroup.read_text(encoding="utf-8").split()
    except OSError:
        return False
    units = [part for group in groups for part in group.split("/") if part.endswith(".service")]
    if not units or units[-1].startswith("user@"):
        return False
    manager = ["--user"] if any(unit.startswith("user@") for unit in units) else []
    ask = [command, *manager, "list-jobs", "--no-legend", "--plain"]
    try:
        jobs = subprocess.run(  # noqa: S603 - fixed words
            ask, capture_output=True, text=True, timeout=JOBS_S, check=True
        ).stdout
    except (OSError, subprocess.SubprocessError) as error:
        log.warning("the service manager does not tell its jobs: %s", error)
        return False
    return re.search(rf"^\s*\d+\s+{re.escape(units[-1])}\s+restart\s", jobs, re.MULTILINE) is not None
