"""Detects whether any program reads pictures from a v4l2loopback device.

From version 0.13 on the driver reports it by an event of its own (V4L2_EVENT_PRI_CLIENT_USAGE, added by v4l2loopback's
pull request 516): it gives every subscriber the number of readers, at once and at each change. Version 0.12 (Debian 12)
has no such event; there the programs that have the node open are counted, and of those only the same user's.
"""

from __future__ import annotations

import errno
import logging
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import UnsupportedByDriverError
from relit_camera.devices.device_users import PROC, find_device_users
from relit_camera.devices.v4l2 import count_readers

log = logging.getLogger(__name__)

DRIVER_POLL_S, PROC_SCAN_S = 0.25, 1.0
"""Seconds between two queries of the driver, and between two scans of /proc."""
DEVICE_GONE_ERRNOS = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
"""What opening a node gives that no longer exists: nobody can read it."""

ReaderQuery = Callable[[str], bool]
"""Called with a device node; returns whether anybody reads pictures from it."""


def driver_reader_count(node: str) -> int:
    """Ask the driver how many programs read pictures from `node`.

    It subscribes anew each time: the first event of a subscription is the present state, so a lost event cannot mislead
    for long.

    Raises:
        UnsupportedByDriverError: the driver has no such event.
        OSError: the node is gone, or no more programs may open it now; ask again later.
    """
    if not sys.platform.startswith("linux"):
        raise UnsupportedByDriverError("only Linux has v4l2loopback")
    device = os.open(node, os.O_RDONLY | os.O_NONBLOCK)
    try:
        return count_readers(device)
    finally:
        os.close(device)


def driver_reports_readers(node: str) -> bool:
    """Ask the driver whether anybody reads pictures from `node`; raises what `driver_reader_count` does."""
    return driver_reader_count(node) > 0


def is_open_elsewhere(node: str, proc: Path = PROC) -> bool:
    """Whether another program of the same user (of any user, for root) has `node` open, to read pictures or not.

    A keeper does not count.
    """
    return any(not user.is_keeper for user in find_device_users(node, proc))


class ReaderMonitor:
    """Watches whether anybody reads the virtual camera at a node, which may change.

    A thread of its own does so, because scanning /proc may take long; it starts with the first call of `has_readers`.
    The driver is asked first. If it does not report its readers, /proc is scanned from then on, and the log says so
    once.
    """

    def __init__(
        self,
        node: Callable[[], str],
        ask: ReaderQuery = driver_reports_readers,
        scan: ReaderQuery = is_open_elsewhere,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._node, self._ask, self._scan, self._clock = node, ask, scan, clock
        self._driver_answers = True
        self._has_readers = self._watching = False
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self.run, name="readers", daemon=True)

    def has_readers(self) -> bool:
        """Whether anybody read it at the last query, at most a second ago."""
        if not self._watching and not self._stopping.is_set():
            self._has_readers = self._query()  # so that the first answer is no guess
            self._watching = True
            self._thread.start()
        return self._has_readers

    def close(self) -> None:
        """End the thread. Harmless when repeated."""
        self._stopping.set()

    def run(self) -> None:
        """Watch in the calling thread until `close`."""
        self._watching = True
        while not self._clock.wait(self._stopping, DRIVER_POLL_S if self._driver_answers else PROC_SCAN_S):
            self._has_readers = self._query()

    def _query(self) -> bool:
        node = self._node()
        try:
            if self._driver_answers:
                return self._ask(node)
        except UnsupportedByDriverError:
            self._driver_answers = False
            log.warning(
                "%s: this v4l2loopback does not tell who reads it (0.13 and newer do); only programs of the same user "
                "are noticed",
                node,
            )
        except OSError as error:
            # A node that exists but may not be opened now leaves the last answer as it was.
            return self._has_readers and error.errno not in DEVICE_GONE_ERRNOS
        return self._scan(node)
