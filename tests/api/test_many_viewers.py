"""Two hundred viewers and one that never reads do not hurt the camera, and leave nothing behind."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest

from relit_camera.api import preview_stream
from relit_camera.api.app import create_app
from relit_camera.api.preview_stream import PreviewVariant, encode_preview
from relit_camera.api.server import connection_timeouts
from relit_camera.api.server.http_server import start_api_server
from relit_camera.base.config.settings import RelitSettings, ServerSettings
from relit_camera.base.images.image_types import DisplayImage
from tests.api.fake_camera import FakeCamera
from tests.api.many_viewers import connect
from tests.cli.relit_command import Material, start
from tests.faults.watched_camera import TimedSink
from tests.lateness import Lateness, spinning
from tests.small_camera import FPS, PATIENT, WAIT_S, running_camera, wait_until

VIEWERS = 200
ROOT = Path(__file__).parents[2]


@contextmanager
def many_viewers(url: str, count: int = VIEWERS) -> Iterator[subprocess.Popen[str]]:
    """So many viewers, and one that never reads, each with a picture by now."""
    command = [sys.executable, "-m", "tests.api.many_viewers", url, str(count)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "open\n"
        yield process
    finally:
        process.communicate(timeout=WAIT_S)


def ask(viewers: subprocess.Popen[str]) -> np.ndarray:
    """How many pictures each viewer has got."""
    assert viewers.stdin is not None
    assert viewers.stdout is not None
    viewers.stdin.write("\n")
    viewers.stdin.flush()
    return np.array(json.loads(viewers.stdout.readline()))


IDLE = """
import json, sys
from tests.lateness import Lateness
with Lateness() as lateness:
    print("idle", flush=True)
    times = json.loads(sys.stdin.readline())
print(lateness.longest_gap_s(times))
"""
"""In a process of its own, which waits for the machine, but not for what this process does."""


@contextmanager
def gap_meter() -> Iterator[Callable[[Sequence[float]], float]]:
    """A function that tells the longest gap between times, but for what the machine made an idle process wait."""
    process = subprocess.Popen(
        [sys.executable, "-c", IDLE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "idle\n"
        yield lambda times: float(process.communicate(json.dumps(times) + "\n", timeout=WAIT_S)[0])
    finally:
        process.kill()
        process.communicate()


def rate(times: Sequence[float]) -> float:
    """Pictures a second."""
    return (len(times) - 1) / (times[-1] - times[0])


@pytest.mark.slow
def test_the_camera_keeps_its_rate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, note_row: Callable[[str, tuple[str, ...]], None]
) -> None:
    process, sink, encoded = psutil.Process(), TimedSink(), list[object]()

    def encode(picture: DisplayImage, variant: PreviewVariant) -> bytes:
        encoded.append(picture)
        return encode_preview(picture, variant)

    monkeypatch.setattr(preview_stream, "encode_preview", encode)
    with gap_meter() as longest_gap_s, running_camera(tmp_path, sink=sink, timings=PATIENT) as camera:
        camera.http.get("snapshot.jpg").raise_for_status()
        sink.wait_for(3)
        frames = len(sink.times)
        wait_until(lambda: len(sink.times) > frames + FPS)
        alone_fps = rate(sink.times[frames:])
        files, threads = process.num_fds(), process.num_threads()
        with many_viewers(f"{camera.http.base_url}preview.mjpg") as viewers:
            began, before = time.monotonic(), ask(viewers)
            made, frames = len(encoded), len(sink.times)
            wait_until(lambda: (ask(viewers) - before).min() >= 6 and len(sink.times) > frames + 2 * FPS)
            got, made, times = ask(viewers) - before, len(encoded) - made, sink.times[frames:]
            most_made = preview_stream.MAX_FRAMES_SENT_PER_S / VIEWERS * (time.monotonic() - began) + 2
            most_threads = process.num_threads()
            camera.put("mode", mode="portrait")
        wait_until(lambda: process.num_fds() <= files)
        wait_until(lambda: camera.status()["state"] == "live")
        gap_s = longest_gap_s(times)
    note_row("two hundred viewers", (f"{rate(times):.1f}", f"{1e3 * gap_s:.0f} ms", f"{got.min()} to {got.max()}"))
    assert gap_s < 0.5
    assert rate(times) > alone_fps / 2  # a busy machine costs a quarter of them
    assert made <= most_made  # each is encoded once, for all of them
    assert most_threads <= threads + 4


@pytest.mark.slow
def test_it_ends_in_time_with_all_of_them_open(tmp_path: Path, material: Material) -> None:
    running = start(
        "run", "--source", material.clip, "--subject", material.subject, "--tracker", material.tracker,
        "--sink", "null", "--port", 0, folder=tmp_path,
    )  # fmt: skip
    try:
        assert running.stdout is not None
        url = running.stdout.readline().split()[-1]
        with many_viewers(f"{url}api/v1/preview.mjpg"), spinning() as spun_s:
            before_s = spun_s()
            running.terminate()
            _, errors = running.communicate(timeout=WAIT_S)
            assert spun_s() - before_s < 3
    finally:
        running.kill()
        running.wait()
    assert running.returncode == 0
    assert "Traceback" not in errors


@pytest.mark.parametrize("path", ["preview.mjpg", "snapshot.jpg"])
def test_who_takes_nothing_is_cut_off(
    tmp_path: Path, settings: RelitSettings, monkeypatch: pytest.MonkeyPatch, path: str
) -> None:
    monkeypatch.setattr(connection_timeouts, "WRITE_TIMEOUT_S", 0.2)
    monkeypatch.setattr(connection_timeouts, "READ_TIMEOUT_S", 10 * WAIT_S)  # is not what cuts them off
    noise = np.random.default_rng(1).integers(0, 256, (720, 1280, 3), np.uint8)
    camera = FakeCamera(tmp_path, noise)
    with start_api_server(create_app(camera, settings), ServerSettings(port=0)) as server:
        before = psutil.Process().num_fds()
        url = f"{server.address.url}api/v1/{path}?"
        with connect(url, 4096) as one, connect(url, 4096) as other:
            for viewer in (one, other):
                viewer.recv(1, socket.MSG_PEEK)  # the answer has begun
            wait_until(lambda: psutil.Process().num_fds() <= before + 2)  # our own ends of the two
    camera.stop()


def test_who_asks_nothing_is_cut_off(tmp_path: Path, settings: RelitSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_timeouts, "READ_TIMEOUT_S", 0.1)
    camera = FakeCamera(tmp_path)
    with start_api_server(create_app(camera, settings), ServerSettings(port=0)) as server:
        for said in (b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: 127"):
            with socket.create_connection((server.address.host, server.address.port), WAIT_S) as client:
                client.sendall(said)
                with Lateness() as lateness, suppress(ConnectionResetError):
                    began = time.monotonic()
                    assert client.recv(100) == b""
                assert lateness.unexplained_s(began, time.monotonic()) < 2
    camera.stop()
