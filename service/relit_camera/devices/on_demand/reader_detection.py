"""Whether anybody takes pictures from a v4l2loopback device.

From version 0.13 on the driver says so itself, by an event of its own (V4L2_EVENT_PRI_CLIENT_USAGE, added by pull
request 516): whoever subscribes is told at once, and at each change, how many take pictures. 0.12 (Debian 12) has
nothing of the kind; there only the programs that have the node open can be counted, and of those only one's own.

Looks out for readers of the virtual camera, in a thread of its own: /proc may be long to read.
"""

from __future__ import annotations

import errno
import logging
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from relit_camera.base.errors import UnsupportedByDriverError
from relit_camera.devices.device_users import PROC, find_device_users
from relit_camera.devices.v4l2 import query_has_readers

ReaderQuery = Callable[[str], bool]
"""(node) → whether anybody takes pictures from it."""


def driver_reports_readers(node: str) -> bool:
    """Ask the driver whether anybody takes pictures from `node`.

    Raises:
        UnsupportedByDriverError: the driver has no such event.
        OSError: the node is gone, or has as many openers as it takes; ask again later.
    """
    if not sys.platform.startswith("linux"):
        raise UnsupportedByDriverError("only Linux has v4l2loopback")
    device = os.open(node, os.O_RDONLY | os.O_NONBLOCK)
    try:
        return query_has_readers(device)
    finally:
        os.close(device)


def is_open_elsewhere(node: str, proc: Path = PROC) -> bool:
    """Whether another program of ours (any, for root) has `node` open, be it to take pictures or not."""
    return bool(find_device_users(node, proc))


log = logging.getLogger(__name__)

DRIVER_POLL_S, PROC_SCAN_S = 0.25, 1.0
"""Seconds between questions to the driver, and between walks through /proc."""
DEVICE_GONE_ERRNOS = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
"""What a node says that is no more: nobody can read it."""


class ReaderMonitor:
    """Knows whether anybody reads the virtual camera at a node, which may change.

    It begins with the first question. The driver is asked first; where it cannot answer, /proc is searched instead, for
    good, and the log says so once.
    """

    def __init__(
        self, node: Callable[[], str], ask: ReaderQuery = driver_reports_readers, scan: ReaderQuery = is_open_elsewhere
    ) -> None:
        self._node, self._ask, self._scan = node, ask, scan
        self._driver_answers = True
        self._has_readers = False
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="readers", daemon=True)

    def has_readers(self) -> bool:
        """Whether somebody read it when it was last looked at: not a second ago."""
        if self._thread.ident is None and not self._stopping.is_set():
            self._has_readers = self._query()  # the first answer is no guess
            self._thread.start()
        return self._has_readers

    def close(self) -> None:
        """End the thread. Harmless when repeated."""
        self._stopping.set()

    def _run(self) -> None:
        while not self._stopping.wait(DRIVER_POLL_S if self._driver_answers else PROC_SCAN_S):
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
            return self._has_readers and error.errno not in DEVICE_GONE_ERRNOS  # crowded: as it was
        return self._scan(node)
