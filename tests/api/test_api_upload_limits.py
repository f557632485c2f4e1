"""Uploads that are too many, beyond the quota, or onto a disk that takes nothing."""

from __future__ import annotations

import asyncio
import errno
import os
from collections.abc import AsyncIterator
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import Any

import httpx
import pytest
import starlette.formparsers

from relit_camera.api.app import create_app
from relit_camera.api.middleware.upload_limits import MAX_UPLOADS, UploadLimitMiddleware
from relit_camera.base.config.settings import RelitSettings, StorageSettings
from tests.api.api_client import Client, check_problem, png
from tests.api.fake_camera import FakeCamera

FORM = "multipart/form-data; boundary=x"


def small(camera: FakeCamera, settings: RelitSettings, quota_gb: float) -> Client:
    """A client of a camera with this quota."""
    folder = settings.storage.data_dir
    storage = StorageSettings(data_dir=folder, quota_gb=quota_gb)
    return Client(create_app(camera, settings.model_copy(update={"storage": storage})))


async def in_parts(body: bytes) -> AsyncIterator[bytes]:
    for start in range(0, len(body), 1000):
        yield body[start : start + 1000]


def form(name: str, data: bytes) -> bytes:
    field = f'--x\r\nContent-Disposition: form-data; name="name"\r\n\r\n{name}\r\n'
    head = '--x\r\nContent-Disposition: form-data; name="file"; filename="a.png"\r\n\r\n'
    return field.encode() + head.encode() + data + b"\r\n--x--\r\n"


def test_what_exceeds_the_quota_is_refused_until_something_is_deleted(
    camera: FakeCamera, settings: RelitSettings
) -> None:
    client = small(camera, settings, 4e-6)
    folder = settings.storage.backgrounds
    folder.mkdir(parents=True)
    (folder / "old.png").write_bytes(bytes(3900))
    problem = check_problem(client.upload("/api/v1/backgrounds", "room", png(), "a.png"), 507)
    assert "4e-06 GB" in problem["what"]
    assert "storage.quota_gb" in problem["cure"]
    check_problem(
        client.put("/api/v1/presets/look", {"lighting": {"yaw_deg": 3, "lamps": [{"name": "x" * 40}] * 4}}), 507
    )
    assert client.put("/api/v1/lighting", {"yaw_deg": 3}).status_code == 200
    assert client.delete("/api/v1/backgrounds/old").status_code == 204
    assert client.upload("/api/v1/backgrounds", "room", png(), "a.png").status_code == 201


def test_a_body_of_unknown_length_is_counted(camera: FakeCamera, settings: RelitSettings) -> None:
    client = small(camera, settings, 1e-5)
    body = form("room", bytes(20_000))
    answer = client.post("/api/v1/backgrounds", content=in_parts(body), headers={"content-type": FORM})
    check_problem(answer, 507)
    answer = client.post("/api/v1/backgrounds", content=in_parts(form("room", png())), headers={"content-type": FORM})
    assert answer.status_code == 201


def test_few_are_received_at_once(tmp_path: Path) -> None:
    """One too many is answered at once, and others as before."""

    async def run() -> None:
        received = asyncio.Event()

        async def app(scope: Any, receive: Any, send: Any) -> None:
            if scope["method"] == "POST":
                await received.wait()
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": b""})

        limited = UploadLimitMiddleware(app, tmp_path, 1 << 30)
        async with httpx.AsyncClient(transport=httpx.ASGITransport(limited), base_url="http://a") as client:
            headers = {"content-type": FORM}
            held = [asyncio.create_task(client.post("/b", content=b"x", headers=headers)) for _ in range(MAX_UPLOADS)]
            await asyncio.sleep(0.05)
            refused = await client.post("/b", content=b"x", headers=headers)
            check_problem(refused, 503)
            assert int(refused.headers["retry-after"]) > 0
            assert (await client.get("/b")).status_code == 200
            received.set()
            assert [answer.status_code for answer in await asyncio.gather(*held)] == [200] * MAX_UPLOADS
            assert (await client.post("/b", content=b"x", headers=headers)).status_code == 200

    asyncio.run(run())


def test_a_full_folder_of_temporary_files_is_said(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(SpooledTemporaryFile[bytes]):
        def write(self, data: Any) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(starlette.formparsers, "SpooledTemporaryFile", Full)
    problem = check_problem(client.upload("/api/v1/backgrounds", "room", png(), "a.png"), 507)
    assert "No space left" in problem["what"]
    assert "free some space" in problem["cure"]


def test_a_disk_that_can_only_be_read_is_said(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(name: str) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), "/data/presets/.a")

    monkeypatch.setattr(camera.scene_controller.backgrounds, "remove", refuse)
    problem = check_problem(client.delete("/api/v1/backgrounds/room"), 507)
    assert "Read-only" in problem["what"]
    assert "/data" not in problem["detail"]


def test_another_error_of_the_system_is_a_fault_of_the_program(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(name: str) -> None:
        raise TimeoutError

    monkeypatch.setattr(camera.scene_controller.backgrounds, "remove", fail)
    check_problem(client.delete("/api/v1/backgrounds/room"), 500)


def test_beyond_the_quota_presets_are_still_shown_and_renamed(camera: FakeCamera, settings: RelitSettings) -> None:
    """What stores nothing is not refused, nor is an empty body."""
    client = small(camera, settings, 4e-6)
    assert client.request("PUT", "/api/v1/presets/look").status_code in (200, 201)
    settings.storage.data_dir.mkdir(parents=True, exist_ok=True)
    (settings.storage.data_dir / "old").write_bytes(bytes(5000))
    assert client.post("/api/v1/presets/look/apply").status_code == 200
    assert client.patch("/api/v1/presets/look", {"name": "other"}).status_code == 200
    assert client.request("PUT", "/api/v1/presets/third").status_code in (200, 201)
    answer = client.post("/api/v1/backgrounds", content=b"x" * 100, headers={"content-type": FORM.upper()})
    check_problem(answer, 507)


def test_a_body_that_grows_beyond_the_quota_is_told_its_cure(camera: FakeCamera, settings: RelitSettings) -> None:
    client = small(camera, settings, 1e-5)
    body = form("room", bytes(20_000))
    answer = client.post("/api/v1/backgrounds", content=in_parts(body), headers={"content-type": FORM})
    assert "storage.quota_gb" in check_problem(answer, 507)["cure"]
