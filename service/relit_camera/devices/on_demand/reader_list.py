"""Lists the programs that take pictures from the virtual camera, for the status; scans only while somebody asks."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import UnsupportedByDriverError
from relit_camera.devices.device_users import DeviceUser, find_device_users, has_mapped_buffers
from relit_camera.devices.on_demand.reader_detection import DEVICE_GONE_ERRNOS, driver_reader_count
from relit_camera.devices.sinks.sink import UNKNOWN, Readers, SinkInfo

SCAN_S = 1.0
"""Seconds between two scans."""
ASKED_S = 5.0
"""Scans end when nobody has asked for so many seconds."""


def all_readers(device: Readers, info: SinkInfo) -> Readers:
    """The readers of a sink: those of its device, and those that come through PipeWire."""
    if info.pipewire is None or not info.id:
        return device if info.pipewire is None else info.pipewire
    counts = [readers.count for readers in (device, info.pipewire) if readers.count is not None]
    return Readers(sum(counts) if counts else None, tuple(dict.fromkeys(device.names + info.pipewire.names)))


def list_readers(
    node: str,
    count: Callable[[str], int] = driver_reader_count,
    users: Callable[[str], list[DeviceUser]] = find_device_users,
    maps: Callable[[DeviceUser, str], bool] = has_mapped_buffers,
) -> Readers:
    """The programs that read pictures from a v4l2loopback node.

    The driver tells how many they are, from version 0.13 on. With an older one, those count that have the node open,
    of the same user only. Their names are those of the programs that map its buffers, or else have it open.

    Args:
        node: such as /dev/video10.
        count: asks the driver.
        users: finds the programs that have a node open.
        maps: whether a program has mapped a node's buffers.
    """
    try:
        counted: int | None = count(node)
    except UnsupportedByDriverError:
        counted = None
    except OSError as error:
        return Readers(0) if error.errno in DEVICE_GONE_ERRNOS else UNKNOWN
    if counted == 0:
        return Readers(0)
    having = [user for user in users(node) if not user.is_keeper]
    reading = [user for user in having if maps(user, node)] or having
    names = tuple(dict.fromkeys(user.name for user in reading))
    return Readers(len(reading) if counted is None else counted, names)


class ReaderList:
    """Keeps the list of readers of a node, which may change, up to date while somebody asks for it."""

    def __init__(
        self,
        node: Callable[[], str],
        scan: Callable[[str], Readers] = list_readers,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up; the first call of `readers` starts a thread.

        Args:
            node: of the virtual camera; empty while none is open.
            scan: lists its readers.
            clock: to measure and wait by.
        """
        self._node, self._scan, self._clock = node, scan, clock
        self._found = UNKNOWN
        self._asked_at = -math.inf
        self._stopping = threading.Event()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def readers(self) -> Readers:
        """Who read it at the last scan, a second ago; unknown until the first one."""
        self._asked_at = self._clock.now()
        if not self._node():
            return UNKNOWN
        with self._lock:
            if self._thread is None and not self._stopping.is_set():
                self._thread = threading.Thread(target=self.run, name="readers-list", daemon=True)
                self._thread.start()
        return self._found

    def close(self) -> None:
        """End the thread. Harmless when repeated."""
        self._stopping.set()

    def run(self) -> None:
        """Scan in the calling thread until `close`, or until nobody has asked for a while."""
        while self._clock.now() - self._asked_at < ASKED_S:
            node = self._node()
            self._found = self._scan(node) if node and sys.platform.startswith("linux") else UNKNOWN
            if self._clock.wait(self._stopping, SCAN_S):
                break
        with self._lock:
            self._thread, self._found = None, UNKNOWN
