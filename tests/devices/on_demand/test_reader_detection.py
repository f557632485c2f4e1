"""When the webcam is wanted, and who is asked about it."""

from __future__ import annotations

import errno
import logging
import struct
from pathlib import Path

import pytest

from relit_camera.base.errors import UnsupportedByDriverError
from relit_camera.devices import v4l2
from relit_camera.devices.on_demand.on_demand_source import IDLE_TIMEOUT_S, DemandMonitor
from relit_camera.devices.on_demand.reader_detection import ReaderMonitor, driver_reports_readers
from tests.small_camera import wait_until


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


class Readers:
    """Stands for the readers of a device."""

    there = False
    error: Exception | None = None
    calls = 0

    def __call__(self, node=""):
        self.calls += 1
        if self.error is not None:
            raise self.error
        return self.there


# Wanted or not.


def test_nobody_wants_it_at_the_start():
    assert not DemandMonitor(Readers()).wanted()


def test_a_reader_wants_it_at_once_and_five_seconds_longer():
    readers, clock = Readers(), Clock()
    demand = DemandMonitor(readers, clock=clock)
    readers.there = True
    assert demand.wanted()
    clock.now += 60
    assert demand.wanted()
    readers.there = False
    clock.now += IDLE_TIMEOUT_S - 0.1
    assert demand.wanted()
    clock.now += 0.2
    assert not demand.wanted()
    assert IDLE_TIMEOUT_S == 5


def test_who_lets_go_and_takes_again_keeps_it_open():
    readers, clock = Readers(), Clock()
    demand = DemandMonitor(readers, clock=clock)
    for there in (True, False) * 20:
        readers.there = there
        assert demand.wanted()
        clock.now += 2.4


def test_a_viewer_counts_as_a_reader():
    clock = Clock()
    demand = DemandMonitor(Readers(), clock=clock)
    demand.note_viewer()
    clock.now += IDLE_TIMEOUT_S - 0.1
    assert demand.wanted()
    clock.now += 0.2
    assert not demand.wanted()


# The watch.


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr("relit_camera.devices.on_demand.reader_detection.DRIVER_POLL_S", 0.01)
    monkeypatch.setattr("relit_camera.devices.on_demand.reader_detection.PROC_SCAN_S", 0.01)


def watch_with(ask, scan, node="/dev/video10"):
    return ReaderMonitor(lambda: node, ask, scan)


def test_the_driver_is_asked_and_proc_left_alone(quick):
    ask, scan = Readers(), Readers()
    watch = watch_with(ask, scan)
    try:
        assert not watch.has_readers()
        ask.there = True
        wait_until(watch.has_readers)
        ask.there = False
        wait_until(lambda: not watch.has_readers())
        assert scan.calls == 0
    finally:
        watch.close()


def test_the_first_answer_is_no_guess():
    ask = Readers()
    ask.there = True
    watch = watch_with(ask, Readers())
    assert watch.has_readers()
    watch.close()


def test_an_old_driver_is_asked_once_then_proc_is_searched(quick, caplog):
    ask, scan = Readers(), Readers()
    ask.error = UnsupportedByDriverError("it is too old")
    watch = watch_with(ask, scan)
    with caplog.at_level(logging.WARNING):
        assert not watch.has_readers()
        scan.there = True
        wait_until(watch.has_readers)
    watch.close()
    assert ask.calls == 1
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith("/dev/video10: this v4l2loopback does not tell who reads it")
    assert "only programs of the same user" in said


def test_a_device_that_cannot_be_opened_now_leaves_the_answer_as_it_was(quick):
    ask = Readers()
    ask.there = True
    watch = watch_with(ask, Readers())
    assert watch.has_readers()
    ask.error = OSError(errno.EBUSY, "too many openers")
    known = ask.calls
    wait_until(lambda: ask.calls > known + 3)
    assert watch.has_readers()
    ask.error, ask.there = None, False
    wait_until(lambda: not watch.has_readers())
    watch.close()


@pytest.mark.parametrize("number", [errno.ENOENT, errno.ENODEV, errno.ENXIO])
def test_nobody_reads_a_device_that_is_gone(quick, number):
    ask = Readers()
    ask.there = True
    watch = watch_with(ask, Readers())
    assert watch.has_readers()
    ask.error = OSError(number, "gone")
    wait_until(lambda: not watch.has_readers())
    ask.error = None
    wait_until(watch.has_readers)
    watch.close()


# What is asked of the driver.


@pytest.fixture
def node(tmp_path):
    path = tmp_path / "video10"
    path.touch()
    return str(path)


def open_files():
    return len(list(Path("/proc/self/fd").iterdir()))


def driver(monkeypatch, answer):
    """Let `fcntl.ioctl` answer like a driver; returns what was asked."""
    asked = []

    def ioctl(device, request, argument):
        asked.append((request, bytes(argument)))
        return answer(request, argument)

    monkeypatch.setattr("fcntl.ioctl", ioctl)
    return asked


@pytest.mark.parametrize("count", [0, 1, 3])
def test_the_first_event_of_a_subscription_is_the_answer(monkeypatch, node, count):
    def answer(request, argument):
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
def test_a_driver_without_the_event_cannot_answer(monkeypatch, node, number):
    def refuse(request, argument):
        raise OSError(number, "no")

    driver(monkeypatch, refuse)
    with pytest.raises(UnsupportedByDriverError):
        driver_reports_readers(node)


def test_a_plain_file_cannot_answer_and_a_missing_one_is_an_os_error(node, tmp_path):
    with pytest.raises(UnsupportedByDriverError):
        driver_reports_readers(node)
    with pytest.raises(FileNotFoundError):
        driver_reports_readers(str(tmp_path / "video11"))
