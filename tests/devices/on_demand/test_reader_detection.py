"""When the webcam is wanted, and how readers are detected."""

from __future__ import annotations

import errno
import logging
import struct
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from relit_camera.base.errors import UnsupportedByDriverError
from relit_camera.devices import v4l2
from relit_camera.devices.on_demand.on_demand_source import IDLE_TIMEOUT_S, DemandMonitor
from relit_camera.devices.on_demand.reader_detection import ReaderMonitor, driver_reports_readers
from tests.small_camera import wait_until
from tests.virtual_clock import VirtualClock


class Readers:
    """The readers of a device, as a query gives them."""

    there = False
    error: Exception | None = None
    calls = 0

    def __call__(self, node: str = "") -> bool:
        self.calls += 1
        if self.error is not None:
            raise self.error
        return self.there


# Wanted or not.


def test_nobody_wants_it_at_the_start() -> None:
    assert not DemandMonitor(Readers()).wanted()


def test_a_reader_wants_it_at_once_and_five_seconds_longer() -> None:
    readers, clock = Readers(), VirtualClock()
    demand = DemandMonitor(readers, clock=clock)
    readers.there = True
    assert demand.wanted()
    clock.sleep(60)
    assert demand.wanted()
    readers.there = False
    clock.sleep(IDLE_TIMEOUT_S - 0.1)
    assert demand.wanted()
    clock.sleep(0.2)
    assert not demand.wanted()
    assert IDLE_TIMEOUT_S == 5


def test_a_program_that_closes_and_reopens_the_camera_keeps_it_wanted() -> None:
    readers, clock = Readers(), VirtualClock()
    demand = DemandMonitor(readers, clock=clock)
    for there in (True, False) * 20:
        readers.there = there
        assert demand.wanted()
        clock.sleep(2.4)


def test_a_viewer_counts_as_a_reader() -> None:
    clock = VirtualClock()
    demand = DemandMonitor(Readers(), clock=clock)
    demand.note_viewer()
    clock.sleep(IDLE_TIMEOUT_S - 0.1)
    assert demand.wanted()
    clock.sleep(0.2)
    assert not demand.wanted()


# The monitor, in virtual time: `run` is what its thread does.


class Watching:
    """A monitor in virtual time, and the times at which its answer changed."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.start = self.clock.now()
        self.ask, self.scan = Readers(), Readers()
        self.monitor = ReaderMonitor(lambda: "/dev/video10", self.ask, self.scan, self.clock)
        self.answers: list[tuple[float, bool]] = []

    def at(self, seconds: float, readers: Readers, there: bool = False, error: Exception | None = None) -> None:
        """Let readers come, go, or fail to answer."""

        def change() -> None:
            readers.there, readers.error = there, error

        self.clock.at(seconds, change)

    def run(self, seconds: float) -> list[tuple[float, bool]]:
        """Watch for some seconds. Returns when the answer became what."""

        def look() -> None:
            found = self.monitor.has_readers()
            if not self.answers or self.answers[-1][1] != found:
                self.answers.append((round(self.clock.now() - self.start, 1), found))

        self.clock.every(0.1, look)
        self.clock.at(seconds, self.monitor.close)
        self.monitor.run()
        return self.answers


def test_the_driver_is_asked_four_times_a_second_and_proc_left_alone() -> None:
    watching = Watching()
    watching.at(2.1, watching.ask, there=True)
    watching.at(4.1, watching.ask, there=False)
    assert watching.run(6.0) == [(0.1, False), (2.3, True), (4.3, False)]
    assert watching.ask.calls == 23
    assert watching.scan.calls == 0


def test_the_first_answer_is_no_guess() -> None:
    ask = Readers()
    ask.there = True
    monitor = ReaderMonitor(lambda: "/dev/video10", ask, Readers())
    assert monitor.has_readers()
    monitor.close()


def test_a_first_question_that_fails_is_asked_again() -> None:
    watching = Watching()
    watching.ask.error = ZeroDivisionError("a bug")
    with pytest.raises(ZeroDivisionError):
        watching.monitor.has_readers()
    watching.ask.error, watching.ask.there = None, True
    assert watching.monitor.has_readers()
    watching.monitor.close()


def test_an_old_driver_is_asked_once_then_proc_is_scanned(caplog: pytest.LogCaptureFixture) -> None:
    watching = Watching()
    watching.ask.error = UnsupportedByDriverError("it is too old")
    watching.at(3.5, watching.scan, there=True)
    with caplog.at_level(logging.WARNING):
        assert watching.run(10.0) == [(0.1, False), (4.3, True)]
    assert watching.ask.calls == 1
    assert watching.scan.calls == 10  # once a second
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith("/dev/video10: this v4l2loopback does not tell who reads it")
    assert "only programs of the same user" in said


def test_a_device_that_cannot_be_opened_now_leaves_the_answer_as_it_was() -> None:
    watching = Watching()
    watching.ask.there = True
    watching.at(2.1, watching.ask, error=OSError(errno.EBUSY, "too many openers"))
    watching.at(60.1, watching.ask, there=False)
    assert watching.run(70.0) == [(0.1, False), (0.3, True), (60.3, False)]


@pytest.mark.parametrize("number", [errno.ENOENT, errno.ENODEV, errno.ENXIO])
def test_nobody_reads_a_device_that_is_gone(number: int) -> None:
    watching = Watching()
    watching.ask.there = True
    watching.at(2.1, watching.ask, error=OSError(number, "gone"))
    watching.at(4.1, watching.ask, there=True)
    assert watching.run(6.0) == [(0.1, False), (0.3, True), (2.3, False), (4.3, True)]


def test_its_thread_starts_with_the_first_question_and_ends() -> None:
    ask = Readers()
    monitor = ReaderMonitor(lambda: "/dev/video10", ask, Readers())
    assert not monitor.has_readers()
    ask.there = True
    wait_until(monitor.has_readers)
    monitor.close()
    wait_until(lambda: not [thread for thread in threading.enumerate() if thread.name == "readers"])


# What is asked of the driver.


@pytest.fixture
def node(tmp_path: Path) -> str:
    path = tmp_path / "video10"
    path.touch()
    return str(path)


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def driver(monkeypatch: pytest.MonkeyPatch, answer: Callable[[int, bytearray], int]) -> list[tuple[int, bytes]]:
    """Let `fcntl.ioctl` answer like a driver; returns what was asked."""
    asked: list[tuple[int, bytes]] = []

    def ioctl(device: int, request: int, argument: bytearray) -> int:
        asked.append((request, bytes(argument)))
        return answer(request, argument)

    monkeypatch.setattr("fcntl.ioctl", ioctl)
    return asked


@pytest.mark.parametrize("count", [0, 1, 3])
def test_the_first_event_of_a_subscription_is_the_answer(
    monkeypatch: pytest.MonkeyPatch, node: str, count: int
) -> None:
    def answer(request: int, argument: bytearray) -> int:
        if request == v4l2.VIDIOC_DQEVENT:
            struct.pack_into("=I4xI", argument, 0, v4l2.EVENT_CLIENT_USAGE, count)
        return 0

    asked = driver(monkeypatch, answer)
    before = open_files()
    assert driver_reports_readers(node) is (count > 0)
    assert open_files() == before
    assert [request for request, _ in asked] == [
        v4l2.VIDIOC_SUBSCRIBE_EVENT,
        v4l2.VIDIOC_DQEVENT,
    ]
    assert struct.unpack("=8I", asked[0][1]) == (0x10E00001, 0, 1, 0, 0, 0, 0, 0)
    assert len(asked[1][1]) == (v4l2.VIDIOC_DQEVENT >> 16) & 0x3FFF  # the size that the request announces


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOTTY])
def test_a_driver_without_the_event_cannot_answer(monkeypatch: pytest.MonkeyPatch, node: str, number: int) -> None:
    def refuse(request: int, argument: bytearray) -> int:
        raise OSError(number, "no")

    driver(monkeypatch, refuse)
    with pytest.raises(UnsupportedByDriverError):
        driver_reports_readers(node)


def test_a_plain_file_cannot_answer_and_a_missing_one_is_an_os_error(node: str, tmp_path: Path) -> None:
    with pytest.raises(UnsupportedByDriverError):
        driver_reports_readers(node)
    with pytest.raises(FileNotFoundError):
        driver_reports_readers(str(tmp_path / "video11"))
