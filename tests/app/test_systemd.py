"""What is reported to systemd: in virtual time, through a socket, and by a real `relit run`."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from relit_camera.app import systemd
from relit_camera.app.systemd import (
    STATUS_INTERVAL_S,
    SystemdNotifier,
    is_being_restarted,
    notify_systemd,
    report_until,
    status_line,
)
from relit_camera.live.status.camera_status import CameraState, CameraStatus, Degradation, DegradationCode, FrameCounts
from tests.api.fake_camera import STATUS
from tests.cli.relit_command import Material, environment
from tests.lateness import Lateness
from tests.small_camera import WAIT_S, wait_until
from tests.virtual_clock import VirtualClock

WATCHDOG_S = 0.5
LONGEST_GAP_S = 1.0
"""Between two signs of life, but for what a busy machine makes any process wait. Without the watchdog it is five."""
INJECTED = """
import sys, time
from pathlib import Path
from relit_camera.base.errors import DeviceError
from relit_camera.devices.sinks.sink import NullSink
real, failing, stuck = NullSink.write, Path(sys.argv.pop(1)), Path(sys.argv.pop(1))
def write(self, image):
    if failing.exists():
        raise DeviceError("the device takes no pictures", "wait")
    while stuck.exists():
        stuck.with_suffix(".reached").touch()
        time.sleep(0.01)
    real(self, image)
NullSink.write = write
sys.argv[0] = "relit"
from relit_camera.cli.main import run
run()
"""
"""`relit` whose sink fails while one file exists, and hangs while another does, beside which it makes a third then."""


class Listener:
    """Takes the place of systemd's socket."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)

    def next(self, timeout_s: float = WAIT_S) -> list[str]:
        """The lines of the next message; empty when none came in time."""
        self._socket.settimeout(timeout_s)
        try:
            return self._socket.recv(4096).decode().split("\n")
        except TimeoutError:
            return []

    def wait_for(self, fits: Callable[[list[str]], bool]) -> None:
        """Take messages up to the first that fits."""
        deadline = time.monotonic() + WAIT_S
        while (left := deadline - time.monotonic()) > 0:
            if (message := self.next(left)) and fits(message):
                return
        raise AssertionError("no such message came")

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[Listener]:
    listener = Listener(str(tmp_path / "notify"))
    yield listener
    listener.close()


@pytest.fixture
def abstract_listener() -> Iterator[Listener]:
    """One at an address that is no file, as systemd uses for containers."""
    listener = Listener(f"@relit-test-{os.getpid()}")
    yield listener
    listener.close()


class Camera:
    """The status of a camera in virtual time; schedule what changes, then `report_for`."""

    def __init__(self, watchdog_s: float | None = 30.0) -> None:
        self.clock = VirtualClock()
        self.start = self.clock.now()
        self.base, self.published = STATUS, 0
        self.manager = RecordingNotifier(watchdog_s)

    def status(self) -> CameraStatus:
        return replace(self.base, frames=FrameCounts(self.published, 0, 0))

    def publish(self) -> None:
        self.published += 1

    def report_for(self, seconds: float) -> list[tuple[float, str]]:
        """Report for some seconds. Returns when which kind of message was sent."""
        over = threading.Event()
        self.clock.at(seconds, over.set)
        self.manager.on_message = lambda first: sent.append((round(self.clock.now() - self.start, 1), first))
        sent: list[tuple[float, str]] = []
        report_until(over, self.manager, self.status, self.clock)
        return sent


class RecordingNotifier(SystemdNotifier):
    """Hands the first line of each message on instead of sending it."""

    def __init__(self, watchdog_s: float | None) -> None:
        super().__init__("/nowhere", watchdog_s)
        self.on_message: Callable[[str], None] = lambda first: None

    def notify(self, *lines: str) -> None:
        self.on_message(lines[0].partition("=")[0])


def test_no_service_manager_no_message() -> None:
    assert SystemdNotifier.from_environment({}) is None
    assert SystemdNotifier.from_environment({"NOTIFY_SOCKET": "vsock:2:1234"}) is None


def test_the_watchdog_is_read_for_this_process_alone() -> None:
    def watchdog(**more: str) -> float | None:
        manager = SystemdNotifier.from_environment({"NOTIFY_SOCKET": "/run/n", **more})
        assert manager is not None
        return manager.watchdog_s

    assert watchdog() is None
    assert watchdog(WATCHDOG_USEC="30000000") == 30.0
    assert watchdog(WATCHDOG_USEC="30000000", WATCHDOG_PID=str(os.getpid())) == 30.0
    assert watchdog(WATCHDOG_USEC="30000000", WATCHDOG_PID="1") is None
    assert watchdog(WATCHDOG_USEC="soon") is None
    assert watchdog(WATCHDOG_USEC="0") is None


def test_ready_comes_with_the_first_picture_and_life_with_the_others() -> None:
    camera = Camera(watchdog_s=30.0)
    camera.clock.at(6.98, camera.publish)
    camera.clock.at(30.0, camera.publish)  # and no more
    assert camera.report_for(60.0) == [(7.0, "READY"), (22.0, "STATUS"), (37.0, "WATCHDOG"), (52.0, "STATUS")]


def test_without_a_watchdog_the_status_is_renewed_all_the_same() -> None:
    camera = Camera(watchdog_s=None)
    camera.publish()
    assert camera.report_for(11.0) == [(0.0, "READY"), (STATUS_INTERVAL_S, "STATUS"), (2 * STATUS_INTERVAL_S, "STATUS")]


def test_a_sink_that_fails_and_is_reported_is_no_camera_that_hangs() -> None:
    def degraded(code: DegradationCode) -> CameraStatus:
        return replace(STATUS, degraded=[Degradation(code=code, what="x", why="y")])

    camera = Camera(watchdog_s=2.0)
    camera.publish()
    for at, code in ((0.5, DegradationCode.SOURCE_FAILED), (2.5, DegradationCode.SINK_FAILED)):
        camera.clock.at(at, lambda code=code: setattr(camera, "base", degraded(code)))  # type: ignore[misc]
    sent = [kind for _, kind in camera.report_for(5.5)]
    assert sent == ["READY", "STATUS", "STATUS", "WATCHDOG", "WATCHDOG", "WATCHDOG"]


def test_a_camera_without_its_virtual_camera_is_ready_to_be_told_about() -> None:
    camera = Camera(watchdog_s=30.0)
    missing = replace(STATUS, degraded=[Degradation(code=DegradationCode.SINK_FAILED, what="x", why="y")])
    camera.clock.at(0.98, lambda: setattr(camera, "base", missing))
    assert camera.report_for(40.0) == [(1.0, "READY"), (16.0, "WATCHDOG"), (31.0, "WATCHDOG")]


@pytest.mark.parametrize("kind", ["listener", "abstract_listener"])
def test_what_is_reported_reaches_the_socket(kind: str, request: pytest.FixtureRequest) -> None:
    listener: Listener = request.getfixturevalue(kind)
    with notify_systemd(lambda: replace(STATUS, frames=FrameCounts(1, 0, 0)), SystemdNotifier(listener.address)):
        assert listener.next() == ["READY=1", f"STATUS={status_line(STATUS)}"]
    listener.wait_for(lambda message: message[0] == "STOPPING=1")


def test_stopped_before_the_first_picture_it_was_never_ready(listener: Listener) -> None:
    with notify_systemd(lambda: replace(STATUS, frames=FrameCounts(0, 0, 0)), SystemdNotifier(listener.address)):
        pass
    assert listener.next() == ["STOPPING=1", "STATUS=stopping"]


def test_a_manager_that_does_not_listen_changes_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with notify_systemd(
        lambda: replace(STATUS, frames=FrameCounts(0, 0, 0)), SystemdNotifier(str(tmp_path / "nobody"))
    ):
        pass
    assert "does not take STOPPING=1" in caplog.text


def test_the_status_is_one_line_with_the_first_degradation() -> None:
    good = replace(STATUS, state=CameraState.LIVE, source="webcam C920", sink="camera /dev/video10", degraded=[])
    assert status_line(good) == "live: webcam C920 to camera /dev/video10"
    failed = Degradation(code=DegradationCode.SINK_FAILED, what="sink failed", why="no\nspace", cure="x")
    other = Degradation(code=DegradationCode.SOURCE_FAILED, what="b", why="c")
    bad = replace(good, degraded=[failed, other])
    assert status_line(bad).endswith("/dev/video10; sink failed: no space")


@contextmanager
def service(listener: Listener, material: Material, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """`relit run` as systemd starts it, of the test pattern."""
    notify = {"NOTIFY_SOCKET": listener.address, "WATCHDOG_USEC": str(int(WATCHDOG_S * 1e6))}
    small = {"RELIT_SOURCE__WIDTH": "128", "RELIT_SOURCE__HEIGHT": "96"}
    process = subprocess.Popen(
        [
            sys.executable, "-c", INJECTED, str(folder / "failing"), str(folder / "stuck"),
            "run", "--source", "pattern", "--sink", "null", "--port", "0",
            "--size", "128x96", "--tracker", material.tracker,
        ],
        env={**environment(folder), **notify, **small}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_a_real_camera_is_ready_alive_silent_when_it_hangs_and_says_when_it_stops(
    listener: Listener, material: Material, tmp_path: Path
) -> None:
    def is_alive(message: list[str]) -> bool:
        return message[0] == "WATCHDOG=1"

    def tells_failure(message: list[str]) -> bool:
        return "sink failed: the device takes no pictures" in message[-1]

    failing, stuck = tmp_path / "failing", tmp_path / "stuck"
    with Lateness() as lateness, service(listener, material, tmp_path) as process:
        first = listener.next()
        assert first, process.stderr and process.stderr.read()
        assert first[0] == "READY=1"
        assert "pattern" in first[1]
        times = []
        for _ in range(4):
            listener.wait_for(is_alive)
            times.append(time.monotonic())
        assert lateness.longest_gap_s(times) < LONGEST_GAP_S

        failing.touch()
        listener.wait_for(tells_failure)
        for _ in range(3):
            message = listener.next()
            assert is_alive(message), message
            assert tells_failure(message), message
        failing.unlink()
        listener.wait_for(lambda message: is_alive(message) and not tells_failure(message))

        stuck.touch()
        wait_until((tmp_path / "stuck.reached").exists)
        listener.wait_for(lambda message: not is_alive(message))
        for _ in range(2):
            message = listener.next()
            assert message[0].startswith("STATUS="), message

        stuck.unlink()
        listener.wait_for(is_alive)
        process.send_signal(signal.SIGTERM)
        listener.wait_for(lambda message: message[0] == "STOPPING=1")
        assert process.wait(WAIT_S) == 0


USER_UNIT = "0::/user.slice/user-1000.slice/user@1000.service/app.slice/relit-camera.service"


@pytest.mark.parametrize(
    ("cgroup", "jobs", "restarted"),
    [
        (USER_UNIT, "  812 relit-camera.service restart running", True),
        (USER_UNIT, "7 other.service restart running\n812 relit-camera.service restart running\n", True),
        (USER_UNIT, "812 relit-camera.service stop running", False),
        (USER_UNIT, "812 my-relit-camera.service restart running", False),
        (USER_UNIT, "", False),
        ("0::/user.slice/user-1000.slice/user@1000.service", "812 user@1000.service restart running", False),
        ("0::/", "812 relit-camera.service restart running", False),
    ],
    ids=["restart", "beside another", "stop", "another's", "no job", "no unit", "no systemd"],
)
def test_a_restart_is_told_from_a_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cgroup: str, jobs: str, restarted: bool
) -> None:
    (tmp_path / "cgroup").write_text(cgroup + "\n")
    (tmp_path / "jobs").write_text(jobs)
    asks = tmp_path / "systemctl"
    asks.write_text(f'#!/bin/sh\n[ "$*" = "--user list-jobs --no-legend --plain" ] && cat {tmp_path}/jobs\n')
    asks.chmod(0o755)
    monkeypatch.setattr(systemd, "JOBS_S", WAIT_S)
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/user/1000/systemd/notify")
    assert is_being_restarted(tmp_path / "cgroup", str(asks)) is restarted
    monkeypatch.delenv("NOTIFY_SOCKET")
    assert not is_being_restarted(tmp_path / "cgroup", str(asks))


def test_a_manager_that_does_not_answer_is_a_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/user/1000/systemd/notify")
    (tmp_path / "cgroup").write_text(USER_UNIT)
    assert not is_being_restarted(tmp_path / "cgroup", str(tmp_path / "missing"))
    assert not is_being_restarted(tmp_path / "missing", "true")
