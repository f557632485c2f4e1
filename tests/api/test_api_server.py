"""Listening, being ready, ending."""

from __future__ import annotations

import logging
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from relit_camera.api.server import http_server
from relit_camera.api.server.http_server import ApiServer, ServerAddress, start_api_server
from relit_camera.api.server.listener import open_listener
from relit_camera.base.config.settings import ServerSettings
from relit_camera.base.errors import ConfigError, PortInUseError
from tests.api.fake_camera import FakeCamera
from tests.lateness import Lateness
from tests.small_camera import WAIT_S


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port: int = taken.getsockname()[1]
        return port


def test_port_0_picks_one_and_says_which(app: FastAPI) -> None:
    with start_api_server(app, ServerSettings(port=0)) as server:
        assert server.address.port > 0
        assert server.address.url == f"http://127.0.0.1:{server.address.port}/"
        assert httpx.get(f"{server.address.url}healthz").json() == {"status": "alive"}


def test_the_port_asked_for_is_the_port(app: FastAPI) -> None:
    port = free_port()
    with start_api_server(app, ServerSettings(port=port)) as server:
        assert server.address.port == port


def test_an_ipv6_address_is_written_in_brackets() -> None:
    assert ServerAddress("::1", 8470).url == "http://[::1]:8470/"


def test_a_port_in_use_is_named_with_a_cure(server: ApiServer, app: FastAPI) -> None:
    port = server.address.port
    with pytest.raises(PortInUseError, match=rf"port {port} on 127\.0\.0\.1 is in use") as caught:
        start_api_server(app, ServerSettings(port=port))
    assert "--port 0" in caught.value.cure


def test_a_port_can_be_taken_early(app: FastAPI) -> None:
    settings = ServerSettings(port=free_port())
    listener = open_listener(settings)
    with pytest.raises(PortInUseError):
        open_listener(settings)
    with start_api_server(app, settings, listener=listener) as server:
        assert server.address.port == settings.port


def test_the_port_is_free_again_after_the_end(app: FastAPI) -> None:
    with start_api_server(app, ServerSettings(port=0)) as server:
        httpx.get(f"{server.address.url}healthz")
    open_listener(ServerSettings(port=server.address.port)).close()


def test_an_address_that_cannot_be_used_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> socket.socket:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(socket, "create_server", refuse)
    with pytest.raises(ConfigError, match=r"port 80 on 127\.0\.0\.1 cannot be used: Permission denied"):
        open_listener(ServerSettings(port=80))


def test_it_ends_within_a_second_with_streams_open(app: FastAPI, monkeypatch: pytest.MonkeyPatch) -> None:
    """The camera does not say that it stops here: the server alone must end its streams."""
    monkeypatch.setattr(http_server, "SHUTDOWN_GRACE_S", WAIT_S)  # none is aborted
    server = start_api_server(app, ServerSettings(port=0))
    opened = threading.Barrier(4)
    ended: list[str] = []

    def look(path: str) -> None:
        with httpx.stream("GET", f"{server.address.url}api/v1/{path}", timeout=WAIT_S) as body:
            chunks = body.iter_bytes()
            next(chunks)
            opened.wait(WAIT_S)
            for _ in chunks:
                pass
        ended.append(path)

    paths = ["preview.mjpg", "preview.mjpg?mirror=true", "events"]
    viewers = [threading.Thread(target=look, args=(path,)) for path in paths]
    for viewer in viewers:
        viewer.start()
    opened.wait(WAIT_S)
    with Lateness() as lateness:
        began = time.monotonic()
        server.stop(WAIT_S)
        assert lateness.unexplained_s(began, time.monotonic()) < 1
    for viewer in viewers:
        viewer.join(WAIT_S)
    assert sorted(ended) == sorted(paths)  # whole answers: no viewer saw a broken connection


@pytest.mark.slow
def test_an_answer_that_takes_too_long_is_a_503_not_a_traceback(
    app: FastAPI, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    begun, release = threading.Event(), threading.Event()

    def slow() -> None:
        begun.set()
        release.wait(WAIT_S)

    monkeypatch.setattr(camera, "reset_neutral_pose", slow)
    answers: list[httpx.Response] = []
    server = start_api_server(app, ServerSettings(port=0))
    url = f"{server.address.url}api/v1/neutral-pose"
    asking = threading.Thread(target=lambda: answers.append(httpx.post(url, timeout=WAIT_S)))
    asking.start()
    assert begun.wait(WAIT_S)
    with Lateness() as lateness, caplog.at_level(logging.ERROR):
        began = time.monotonic()
        server.stop(WAIT_S)
        assert lateness.unexplained_s(began, time.monotonic()) < 2
    release.set()
    asking.join(WAIT_S)
    assert answers[0].status_code == 503
    assert "stopping" in answers[0].json()["what"]
    assert not any(record.exc_info for record in caplog.records)


PROGRAM = """
import signal, sys, threading
from pathlib import Path
import cv2, numpy as np
from tests.api.fake_camera import FakeCamera
from relit_camera.api.app import create_app
from relit_camera.api.server import http_server
from relit_camera.base.config.settings import RelitSettings, ServerSettings, StorageSettings

def work_in_opencv():
    picture = np.zeros((720, 1280, 3), np.float32)
    print("at work", flush=True)
    while not ended.is_set():
        cv2.GaussianBlur(picture, (0, 0), 3)
    for _ in range(10):
        cv2.GaussianBlur(picture, (0, 0), 3)

http_server.SHUTDOWN_GRACE_S = 0.1
folder = Path(sys.argv[1])
stop, ended = threading.Event(), threading.Event()
signal.signal(signal.SIGINT, lambda *_: print("interrupted", flush=True))
signal.signal(signal.SIGTERM, lambda *_: stop.set())
camera = FakeCamera(folder)
camera.reset_neutral_pose = work_in_opencv
app = create_app(camera, RelitSettings(storage=StorageSettings(data_dir=folder)))
with http_server.start_api_server(app, ServerSettings(port=0)) as server:
    print(server.address.url, flush=True)
    while not stop.wait(0.1):
        pass
ended.set()
"""


@pytest.mark.slow
def test_signals_are_the_program_s_and_it_exits_clean(tmp_path: Path) -> None:
    """Also while an answer is being worked on: Python cuts daemon threads off inside C++ code, which aborts."""
    process = subprocess.Popen(
        [sys.executable, "-W", "error", "-c", PROGRAM, str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    try:
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        asking = threading.Thread(target=lambda: httpx.post(f"{url}api/v1/neutral-pose", timeout=WAIT_S))
        asking.start()
        assert process.stdout.readline() == "at work\n"
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "interrupted\n"
        with httpx.stream("GET", f"{url}api/v1/preview.mjpg", timeout=WAIT_S) as body:
            next(body.iter_bytes())
            process.send_signal(signal.SIGTERM)
            _, errors = process.communicate(timeout=WAIT_S)
        asking.join(WAIT_S)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0
    assert "Traceback" not in errors


def test_answers_do_not_wait_for_the_client_s_acknowledgement() -> None:
    """An answer is written in two parts: with Nagle's algorithm the second is sent 40 ms later."""
    with open_listener(ServerSettings(port=0)) as listener, socket.create_connection(listener.getsockname()):
        connection, _ = listener.accept()
        with connection:
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
