"""What systemd is told: by a stand-in for its socket, with made-up figures and with a real `relit run`."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from relit_camera.app.systemd import SystemdNotifier, notify_systemd, status_line
from relit_camera.live.status.camera_status import CameraState, CameraStatus, Degradation, FrameCounts
from tests.api.fake_camera import STATUS
from tests.cli.relit_command import Material, environment

pytestmark = pytest.mark.real_time

START_S = 60.0
WATCHDOG_S = 1.0
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
        time.sleep(0.01)
    real(self, image)
NullSink.write = write
sys.argv[0] = "relit"
from relit_camera.cli.main import run
run()
"""
"""`relit` whose sink fails while one file exists, and hangs while another does."""


class Listener:
    """Stands for systemd's socket."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)

    def next(self, timeout_s: float = START_S) -> list[str]:
        """The lines of the next message; empty when none came in time."""
        self._socket.settimeout(timeout_s)
        try:
            return self._socket.recv(4096).decode().split("\n")
        except TimeoutError:
            return []

    def wait_for(self, line: str, timeout_s: float = START_S) -> list[str]:
        """The first message that has a line; what came before it is passed over."""
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0:
            message = self.next(left)
            if line in message:
                return message
        raise AssertionError(f"{line} did not come")

    def close(self) -> None:
        self._socket.close()

    def drain(self) -> None:
        while self.next(0.05):
            pass


@pytest.fixture(params=["path", "abstract"])
def listener(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Listener]:
    listener = Listener(str(tmp_path / "notify") if request.param == "path" else f"@relit-test-{os.getpid()}")
    yield listener
    listener.close()


class Camera:
    """Figures of a camera that publishes as it is told."""

    def __init__(self) -> None:
        self.base, self.published = STATUS, 0

    def __call__(self) -> CameraStatus:
        return replace(self.base, frames=FrameCounts(self.published, 0, 0))


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


def test_ready_comes_with_the_first_picture_and_life_with_the_others(listener: Listener) -> None:
    camera = Camera()
    with notify_systemd(camera, SystemdNotifier(listener.address, watchdog_s=0.2)):
        assert listener.next(0.3) == []
        camera.published = 1
        assert listener.next()[0] == "READY=1"
        assert listener.next()[0].startswith("STATUS=")  # nothing was published since
        camera.published = 2
        assert "WATCHDOG=1" in listener.wait_for("WATCHDOG=1")
        assert "WATCHDOG=1" not in listener.next()
    listener.wait_for("STOPPING=1")


def test_a_sink_that_fails_and_is_told_is_no_camera_that_hangs(listener: Listener) -> None:
    camera = Camera()
    camera.published = 1
    other, sink = Degradation("source failed", "x"), Degradation("sink failed", "the device takes no pictures")
    with notify_systemd(camera, SystemdNotifier(listener.address, watchdog_s=0.2)):
        assert listener.next()[0] == "READY=1"
        camera.base = replace(STATUS, degraded=[other])
        assert "WATCHDOG=1" not in listener.next()
        camera.base = replace(STATUS, degraded=[other, sink])
        listener.wait_for("WATCHDOG=1")
        listener.wait_for("WATCHDOG=1")


def test_stopped_before_the_first_picture_it_was_never_ready(listener: Listener) -> None:
    with notify_systemd(Camera(), SystemdNotifier(listener.address)):
        pass
    assert listener.next() == ["STOPPING=1", "STATUS=stopping"]


def test_a_manager_that_does_not_listen_changes_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with notify_systemd(Camera(), SystemdNotifier(str(tmp_path / "nobody"))):
        pass
    assert "cannot be told STOPPING=1" in caplog.text


def test_the_status_is_one_line_with_the_first_trouble() -> None:
    good = replace(STATUS, state=CameraState.LIVE, source="webcam C920", sink="camera /dev/video10", degraded=[])
    assert status_line(good) == "live: webcam C920 to camera /dev/video10"
    bad = replace(good, degraded=[Degradation("sink failed", "no\nroom", "x"), Degradation("b", "c")])
    assert status_line(bad).endswith("/dev/video10; sink failed: no room")


@contextmanager
def service(listener: Listener, material: Material, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """`relit run` as systemd starts it, of the test pattern."""
    told = {"NOTIFY_SOCKET": listener.address, "WATCHDOG_USEC": str(int(WATCHDOG_S * 1e6))}
    small = {"RELIT_SOURCE__WIDTH": "128", "RELIT_SOURCE__HEIGHT": "96"}
    process = subprocess.Popen(
        [
            sys.executable, "-c", INJECTED, str(folder / "failing"), str(folder / "stuck"),
            "run", "--source", "pattern", "--sink", "null", "--port", "0",
            "--size", "128x96", "--tracker", material.tracker,
        ],
        env={**environment(folder), **told, **small}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_a_real_camera_is_ready_alive_silent_when_it_hangs_and_says_when_it_stops(
    listener: Listener, material: Material, tmp_path: Path
) -> None:
    failing, stuck = tmp_path / "failing", tmp_path / "stuck"
    with service(listener, material, tmp_path) as process:
        first = listener.next()
        assert first, process.stderr and process.stderr.read()
        assert first[0] == "READY=1"
        assert "pattern" in first[1]
        times = []
        for _ in range(4):
            listener.wait_for("WATCHDOG=1")
            times.append(time.monotonic())
        assert max(b - a for a, b in pairwise(times)) < WATCHDOG_S

        failing.touch()
        time.sleep(WATCHDOG_S)  # what was on its way
        listener.drain()
        for _ in range(3):
            message = listener.next()
            assert message[0] == "WATCHDOG=1", message
            assert "sink failed: the device takes no pictures" in message[1]
        failing.unlink()
        time.sleep(2 * WATCHDOG_S)  # it is tried again each second
        listener.drain()
        assert "sink failed" not in listener.wait_for("WATCHDOG=1")[1]

        stuck.touch()
        time.sleep(WATCHDOG_S)
        listener.drain()
        for _ in range(3):
            message = listener.next()
            assert message[0].startswith("STATUS="), message

        stuck.unlink()
        listener.wait_for("WATCHDOG=1")
        process.send_signal(signal.SIGTERM)
        listener.wait_for("STOPPING=1")
        assert process.wait(START_S) == 0
