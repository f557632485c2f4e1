"""Server-sent events."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from types import SimpleNamespace
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi import FastAPI

from relit_camera.api.routes import server_sent_events
from relit_camera.api.server.http_server import ApiServer
from relit_camera.base.config.look import Lighting, Look
from tests.api.api_client import Client, hdr, png
from tests.api.fake_camera import FakeCamera
from tests.lateness import Lateness
from tests.small_camera import WAIT_S, wait_until
from tests.virtual_clock import VirtualClock

Happening = tuple[str, dict[str, Any]]


class Listener:
    """Reads a text/event-stream as the HTML standard says: fields until an empty line."""

    def __init__(self, body: httpx.Response) -> None:
        self.lines = body.iter_lines()
        self.comments = 0

    def __iter__(self) -> Iterator[Happening]:
        kind, data = "message", ""
        for line in self.lines:
            name, _, value = line.partition(":")
            if line.startswith(":"):
                self.comments += 1
            elif name == "event":
                kind = value.strip()
            elif name == "data":
                data += value.strip()
            elif not line and data:
                yield kind, json.loads(data)
                kind, data = "message", ""

    def wait_for(self, kind: str, **expected: object) -> dict[str, Any]:
        for found, data in self:
            if found == kind and all(data.get(name) == value for name, value in expected.items()):
                return data
        raise AssertionError(f"the stream ended without {kind} {expected}")


@pytest.fixture
def listener(server: ApiServer) -> Iterator[Listener]:
    with httpx.stream("GET", f"{server.address.url}api/v1/events", timeout=WAIT_S) as body:
        assert body.headers["content-type"].startswith("text/event-stream")
        yield Listener(body)


def test_a_listener_first_gets_what_stands(listener: Listener, camera: FakeCamera) -> None:
    stream = iter(listener)
    kind, scene = next(stream)
    assert kind == "scene"
    assert scene == {
        "revision": camera.scene_controller.scene.revision,
        "lighting": Lighting().model_dump(mode="json"),
        "background": {"kind": "none"},
        "mode": "live",
        "subject": None,
        "rung": None,
        "unlit_allowed": False,
        "avatar_allowed": False,
        "frozen": False,
        "can_undo": False,
        "can_redo": False,
    }
    kind, status = next(stream)
    assert kind == "status"
    assert status["tracker"] == {"name": "mesh", "state": "found"}


def test_two_listeners_hear_a_change_at_once(server: ApiServer, listener: Listener, client: Client) -> None:
    with Lateness() as lateness, httpx.stream("GET", f"{server.address.url}api/v1/events", timeout=WAIT_S) as body:
        other = Listener(body)
        listener.wait_for("status")
        other.wait_for("status")
        began = time.monotonic()
        client.patch("/api/v1/lighting", {"yaw_deg": 25})
        for heard in (listener, other):
            assert heard.wait_for("scene")["lighting"]["yaw_deg"] == 25
        assert lateness.unexplained_s(began, time.monotonic()) < 0.6


def test_changes_that_did_not_come_over_the_api_are_heard_too(listener: Listener, camera: FakeCamera) -> None:
    listener.wait_for("status")
    camera.scene_controller.set_look(Look(lighting=Lighting(blend=0.25)))
    assert listener.wait_for("scene")["lighting"]["blend"] == 0.25
    camera.scene_controller.set_frozen(True)
    assert listener.wait_for("scene")["frozen"] is True


def test_what_the_camera_tells_is_passed_on(listener: Listener, camera: FakeCamera) -> None:
    listener.wait_for("status")
    camera.events.publish("tracking", state="lost")
    assert listener.wait_for("tracking")["state"] == "lost"


@pytest.mark.parametrize(
    ("collection", "data", "file_name"), [("environments", hdr(), "a.hdr"), ("backgrounds", png(), "a.png")]
)
def test_collections_that_change_are_named(
    listener: Listener, client: Client, collection: str, data: bytes, file_name: str
) -> None:
    listener.wait_for("status")
    client.upload(f"/api/v1/{collection}", "new", data, file_name)
    listener.wait_for("collection", name=collection)
    client.delete(f"/api/v1/{collection}/new")
    listener.wait_for("collection", name=collection)


def test_presets_that_change_are_named(listener: Listener, client: Client) -> None:
    listener.wait_for("status")
    client.request("PUT", "/api/v1/presets/new")
    listener.wait_for("collection", name="presets")


def test_status_comes_every_second(app: FastAPI, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = VirtualClock()

    async def sleep(seconds: float) -> None:
        clock.sleep(seconds)

    async def status_times(count: int) -> list[float]:
        times = list[float]()
        async for event in server_sent_events.event_stream(app.state.context):
            if event.event == "status":
                times.append(clock.now())
            if len(times) == count:
                break
        return times

    monkeypatch.setattr(server_sent_events, "time", SimpleNamespace(monotonic=clock.now))
    monkeypatch.setattr(server_sent_events, "asyncio", SimpleNamespace(sleep=sleep))
    times = asyncio.run(status_times(5))
    assert np.diff(times) == pytest.approx(1.0, abs=1.5 * server_sent_events.SCENE_POLL_S)


def test_the_heart_beats(server: ApiServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_sent_events, "HEARTBEAT_INTERVAL_S", 0.05)
    with httpx.stream("GET", f"{server.address.url}api/v1/events", timeout=WAIT_S) as body:
        beats = (line for line in islice(body.iter_lines(), 20) if line.startswith(":"))
        assert len(list(islice(beats, 2))) == 2


def test_the_stream_ends_when_the_camera_does(listener: Listener, camera: FakeCamera) -> None:
    with Lateness() as lateness:
        listener.wait_for("status")
        camera.stop()
        began = time.monotonic()
        assert [kind for kind, _ in listener if kind == "scene"] == []
        assert lateness.unexplained_s(began, time.monotonic()) < 1


def test_a_listener_who_left_is_forgotten(
    server: ApiServer, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    listen, listening = camera.events.listen, list[object]()

    @contextmanager
    def counted() -> Iterator[object]:
        with listen() as events:
            listening.append(events)
            try:
                yield events
            finally:
                listening.remove(events)

    monkeypatch.setattr(camera.events, "listen", counted)
    with httpx.stream("GET", f"{server.address.url}api/v1/events", timeout=WAIT_S) as body:
        listener = Listener(body)  # held: the answer is closed with the last reference to its lines
        listener.wait_for("status")
        assert len(listening) == 1
    wait_until(lambda: not listening)
