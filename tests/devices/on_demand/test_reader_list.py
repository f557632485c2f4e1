"""Which programs read the virtual camera: what the driver and /proc tell, and how long it is looked for."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable

import pytest

from relit_camera.base.errors import UnsupportedByDriverError
from relit_camera.devices.device_users import DeviceUser
from relit_camera.devices.on_demand.reader_list import ASKED_S, SCAN_S, ReaderList, list_readers
from relit_camera.devices.sinks.sink import UNKNOWN, Readers
from tests.virtual_clock import VirtualClock

NODE = "/dev/video10"
FIREFOX, ZOOM, WATCHER = DeviceUser(3, "firefox"), DeviceUser(4, "zoom"), DeviceUser(5, "wireplumber")


def driver(answer: int | Exception) -> Callable[[str], int]:
    def count(node: str) -> int:
        assert node == NODE
        if isinstance(answer, Exception):
            raise answer
        return answer

    return count


@pytest.mark.parametrize(
    ("answer", "having", "mapping", "found"),
    [
        (0, [WATCHER], [], Readers(0)),  # it has the node open, and reads nothing
        (1, [WATCHER, FIREFOX], [FIREFOX], Readers(1, ("firefox",))),
        (2, [FIREFOX], [FIREFOX], Readers(2, ("firefox",))),  # the other is another user's
        (1, [ZOOM], [], Readers(1, ("zoom",))),  # it reads without mapping
        (UnsupportedByDriverError("0.12"), [FIREFOX, FIREFOX], [FIREFOX], Readers(2, ("firefox",))),
        (UnsupportedByDriverError("0.12"), [], [], Readers(0)),
        (OSError(errno.ENOENT, "gone"), [], [], Readers(0)),
        (OSError(errno.EBUSY, "busy"), [FIREFOX], [], UNKNOWN),
    ],
)
def test_readers(answer: int | Exception, having: list[DeviceUser], mapping: list[DeviceUser], found: Readers) -> None:
    assert list_readers(NODE, driver(answer), lambda node: having, lambda user, node: user in mapping) == found


class Watched:
    """A list of readers whose thread runs only as the test says."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock, self.node, self.scans, self.found = VirtualClock(), NODE, 0, Readers(1, ("zoom",))
        self.started = 0
        monkeypatch.setattr(threading.Thread, "start", self._start)
        self.list = ReaderList(lambda: self.node, self._scan, self.clock)

    def _start(self) -> None:
        self.started += 1

    def _scan(self, node: str) -> Readers:
        self.scans += 1
        return self.found


def test_it_is_looked_for_while_somebody_asks_and_not_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    assert watched.list.readers() == UNKNOWN  # nobody has looked yet
    assert watched.started == 1
    answers: list[Readers] = []
    for at in (0.5, 1.5, 4.0):
        watched.clock.at(at, lambda: answers.append(watched.list.readers()))
    watched.clock.at(2.0, lambda: setattr(watched, "found", Readers(0)))
    watched.list.run()
    assert answers == [Readers(1, ("zoom",)), Readers(1, ("zoom",)), Readers(0)]
    assert watched.scans == pytest.approx((4.0 + ASKED_S) / SCAN_S, abs=1)
    assert watched.started == 1
    assert watched.list.readers() == UNKNOWN
    assert watched.started == 2


def test_without_a_virtual_camera_nobody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.node = ""
    assert watched.list.readers() == UNKNOWN
    assert watched.started == 0


def test_closing_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.list.readers()
    watched.list.close()
    watched.list.run()
    assert watched.scans <= 1
    watched.list.readers()
    assert watched.started == 1
