"""Connections that are cut off, those that are not, and requests that wait for each other."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Iterator
from contextlib import suppress

import httpx
import pytest
from fastapi import FastAPI

from relit_camera.api.app import create_app
from relit_camera.api.dependencies import MAX_IMAGE_WORK
from relit_camera.api.server import connection_timeouts
from relit_camera.api.server.http_server import (
    MALFORMED_INTERVAL_S,
    MALFORMED_REQUEST,
    ApiServer,
    MalformedRequestFilter,
    start_api_server,
)
from relit_camera.base.config.settings import RelitSettings, ServerSettings
from tests.api.api_client import BASE_URL
from tests.api.fake_camera import FakeCamera
from tests.lateness import Lateness
from tests.small_camera import WAIT_S

SILENT_S = 0.4
PATIENT_S = 2.0
"""Where a client must speak again in time, busy as the machine may be."""
TOKEN = "0123456789abcdef" * 2


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_timeouts, "READ_TIMEOUT_S", SILENT_S)
    monkeypatch.setattr(connection_timeouts, "WRITE_TIMEOUT_S", SILENT_S)


@pytest.fixture
def server(app: FastAPI) -> Iterator[ApiServer]:
    with start_api_server(app, ServerSettings(port=0)) as server:
        yield server


def connect(server: ApiServer) -> socket.socket:
    return socket.create_connection((server.address.host, server.address.port), WAIT_S)


def question(server: ApiServer, line: str, *headers: str) -> bytes:
    return "\r\n".join([f"{line} HTTP/1.1", f"Host: 127.0.0.1:{server.address.port}", *headers, "", ""]).encode()


def ask_whether_alive(server: ApiServer, client: socket.socket) -> None:
    client.sendall(question(server, "GET /healthz"))
    answer = b""
    while b"alive" not in answer:
        piece = client.recv(1 << 16)
        assert piece
        answer += piece


def is_cut_off(client: socket.socket) -> bool:
    """Whether the server ends the connection in time, but for what it had to wait, whatever it sends before."""
    with Lateness() as lateness:
        began = time.monotonic()
        while (left := 4 * SILENT_S - lateness.unexplained_s(began, time.monotonic())) > 0:
            client.settimeout(left)
            try:
                if not client.recv(1 << 16):
                    return True
            except TimeoutError:
                continue
            except ConnectionError:
                return True
    return False


@pytest.mark.parametrize("more", [b"", b"G", b"GET /healthz HTTP/1.1\r\nHost: 127"], ids=["nothing", "a byte", "half"])
def test_who_asked_once_and_then_nothing_whole_is_cut_off(server: ApiServer, more: bytes) -> None:
    with connect(server) as client:
        ask_whether_alive(server, client)
        client.sendall(more)
        assert is_cut_off(client)


def test_bytes_now_and_then_are_no_question(server: ApiServer) -> None:
    with Lateness() as lateness, connect(server) as client:
        client.settimeout(SILENT_S / 8)
        began = time.monotonic()
        for byte in question(server, "GET /healthz", f"X-Long: {'x' * 100}"):
            try:
                client.sendall(bytes([byte]))
                if not client.recv(1):
                    break
            except TimeoutError:
                continue
            except ConnectionError:
                break
        assert lateness.unexplained_s(began, time.monotonic()) < 4 * SILENT_S


@pytest.mark.parametrize("path", ["/login", "/api/v1/subject"])
def test_a_body_that_does_not_come_is_not_waited_for(camera: FakeCamera, settings: RelitSettings, path: str) -> None:
    guarded = settings.model_copy(update={"server": ServerSettings(port=0, token=TOKEN)})
    headers = ("Content-Length: 100", "Content-Type: application/json", f"Authorization: Bearer {TOKEN}")
    with start_api_server(create_app(camera, guarded), guarded.server) as server, connect(server) as client:
        client.sendall(question(server, f"{'POST' if path == '/login' else 'PUT'} {path}", *headers) + b"t")
        assert is_cut_off(client)


@pytest.mark.slow
def test_a_body_that_comes_slowly_is_taken(server: ApiServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_timeouts, "READ_TIMEOUT_S", PATIENT_S)
    monkeypatch.setattr(connection_timeouts, "MIN_BODY_BYTES_PER_TIMEOUT", 10)
    body = b'{"name": null}' + b" " * 200
    with connect(server) as client:
        headers = (f"Content-Length: {len(body)}", "Content-Type: application/json")
        client.sendall(question(server, "PUT /api/v1/subject", *headers))
        for start in range(0, len(body), 10):
            client.sendall(body[start : start + 10])
            time.sleep(PATIENT_S / 16)
        assert client.recv(1 << 16).startswith(b"HTTP/1.1 200")


@pytest.mark.slow
@pytest.mark.parametrize("path", ["events", "preview.mjpg"])
def test_a_stream_that_is_taken_goes_on(server: ApiServer, path: str) -> None:
    with connect(server) as client:
        client.sendall(question(server, f"GET /api/v1/{path}"))
        assert not is_cut_off(client)


@pytest.mark.slow
def test_who_asks_again_in_time_stays(server: ApiServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_timeouts, "READ_TIMEOUT_S", PATIENT_S)
    with connect(server) as client:
        for _ in range(8):
            ask_whether_alive(server, client)
            time.sleep(PATIENT_S / 6)


def test_a_body_whose_length_is_stated_twice_is_refused_and_the_connection_ended(server: ApiServer) -> None:
    with connect(server) as client:
        both = "Content-Length: 4", "Transfer-Encoding: chunked", "Content-Type: application/json"
        client.sendall(question(server, "PATCH /api/v1/lighting", *both) + b"0\r\n\r\nGET /healthz HTTP/1.1\r\n")
        assert b" 400 " in client.recv(1 << 16).partition(b"\r\n")[0]
        assert is_cut_off(client)


@pytest.mark.parametrize("path", ["/healthz", "/nothing", "/api/v1/lighting"])
def test_a_body_without_end_is_cut_off(server: ApiServer, monkeypatch: pytest.MonkeyPatch, path: str) -> None:
    monkeypatch.setattr(connection_timeouts, "READ_TIMEOUT_S", 60.0)
    monkeypatch.setattr(connection_timeouts, "MAX_UNREAD_BODY_BYTES", 4 << 20)
    sent, chunk = 0, b"10000\r\n" + bytes(1 << 16) + b"\r\n"
    with connect(server) as client:
        headers = "Transfer-Encoding: chunked", "Content-Type: application/json"
        client.sendall(question(server, f"PUT {path}", *headers))
        with suppress(ConnectionError):
            while sent < 64 << 20:
                client.sendall(chunk)
                sent += len(chunk)
    assert sent < 32 << 20  # buffers of the system hold some


@pytest.mark.parametrize(("path", "is_told"), [("/api/v1/replays", True), ("/api/v1/backgrounds", False)])
def test_who_sends_a_large_form_that_is_refused_early_hears_why(
    server: ApiServer, monkeypatch: pytest.MonkeyPatch, path: str, is_told: bool
) -> None:
    """Most clients send all before they read."""
    monkeypatch.setattr(connection_timeouts, "READ_TIMEOUT_S", 60.0)
    monkeypatch.setattr(connection_timeouts, "MAX_UNREAD_BODY_BYTES", 1 << 20)
    body = bytes(48 << 20)
    answer = b""
    with connect(server) as client, suppress(ConnectionError):
        headers = f"Content-Length: {len(body)}", "Content-Type: text/plain"
        client.sendall(question(server, f"POST {path}", *headers))
        time.sleep(0.5)  # so that the answer comes before the body
        client.sendall(body)
        answer = client.recv(1 << 16)
    assert answer.startswith(b"HTTP/1.1 4") is is_told


def test_malformed_requests_do_not_fill_the_log(server: ApiServer, caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(20):
        with connect(server) as client:
            client.sendall(b"\0\1\2\r\n\r\n")
            assert b" 400 " in client.recv(1000)
    assert sum("Invalid HTTP request" in record.getMessage() for record in caplog.records) <= 2


def test_malformed_requests_are_counted_in_the_log() -> None:
    now = [0.0]
    few = MalformedRequestFilter(lambda: now[0])

    def passes(text: str) -> str | None:
        record = logging.LogRecord("uvicorn.error", logging.WARNING, "", 0, text, None, None)
        return record.getMessage() if few.filter(record) else None

    assert [passes(MALFORMED_REQUEST) for _ in range(3)] == [MALFORMED_REQUEST, None, None]
    assert passes("another") == "another"
    now[0] = MALFORMED_INTERVAL_S
    assert passes(MALFORMED_REQUEST) == f"{MALFORMED_REQUEST} (2 more since the last such line)"
    assert passes(MALFORMED_REQUEST) is None


def test_changes_are_answered_while_many_wait_for_pictures(app: FastAPI) -> None:
    """A file is decoded, and more requests wait for pictures than there are threads: most are refused."""
    context = app.state.context

    async def run() -> tuple[httpx.Response, list[int]]:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url=BASE_URL) as client:
            with context.image_work_lock:
                asked = [
                    asyncio.create_task(client.get("/api/v1/environments/studio/thumbnail.jpg")) for _ in range(60)
                ]
                await asyncio.wait(asked, timeout=30, return_when=asyncio.FIRST_COMPLETED)
                change = asyncio.create_task(client.patch("/api/v1/lighting", json={"yaw_deg": 3}))
                changed = await asyncio.wait_for(change, timeout=30)
                async with asyncio.timeout(60):  # each that is refused has come while the others wait
                    while sum(task.done() for task in asked) < 60 - MAX_IMAGE_WORK:
                        await asyncio.sleep(0.01)
            return changed, [answer.status_code for answer in await asyncio.gather(*asked)]

    changed, statuses = asyncio.run(run())
    assert changed.status_code == 200
    assert statuses.count(200) == MAX_IMAGE_WORK
    assert statuses.count(503) == 60 - MAX_IMAGE_WORK
