"""Errors that belong to no operation, and what problems must not tell."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from fastapi import FastAPI

from relit_camera.api.middleware.body_limits import MAX_JSON_BYTES, MAX_UPLOAD_FORM_BYTES
from relit_camera.api.problem_details import problem_response_from, redact_folders, status_for_error
from relit_camera.base.errors import ConflictError, DeviceError, ImageError, NotFoundError, RelitError, StorageError
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera


def test_unknown_paths_are_not_found(client: Client) -> None:
    problem = check_problem(client.get("/api/v1/lightning"), 404)
    assert "/api/v1/lightning" in problem["what"]
    assert "openapi.json" in problem["cure"]
    check_problem(client.get("/panel/nothing.js"), 404)
    check_problem(client.get("/panel/../app.py"), 404)


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("POST", "lighting", "GET, PUT, PATCH"),
        ("DELETE", "mode", "GET, PUT"),
        ("GET", "neutral-pose", "POST"),
        ("PATCH", "presets/evening", "GET, PUT, DELETE"),
    ],
)
def test_other_methods_are_told_which_are_allowed(client: Client, method: str, path: str, allowed: str) -> None:
    answer = client.request(method, f"/api/v1/{path}")
    problem = check_problem(answer, 405)
    assert answer.headers["allow"] == allowed
    assert allowed in problem["cure"]


def test_a_fault_of_ours_tells_nothing_of_itself(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails() -> None:
        raise RuntimeError("secret of /home/ada/thing.py")

    monkeypatch.setattr(camera, "status", fails)
    answer = client.get("/api/v1/status")
    check_problem(answer, 500)
    assert "secret" not in answer.text
    assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (NotFoundError("a"), 404),
        (ImageError("a"), 422),
        (StorageError("a"), 507),
        (DeviceError("a"), 503),
        (ConflictError("a"), 409),
        (RelitError("a"), 500),
    ],
)
def test_every_kind_of_error_has_its_status(error: RelitError, status: int) -> None:
    assert status_for_error(error) == status
    assert problem_response_from(error).status_code == status


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (f"cannot write {Path.home()}/My Pictures/a.yaml: full", "cannot write My Pictures/a.yaml: full"),
        ("no picture at /mnt/data/x.png", "no picture at x.png"),
        ("'/var/lib/relit/a.hdr' is black", "'a.hdr' is black"),
        (r"no file C:\Users\Ada\cam.relit", "no file cam.relit"),
        ("/dev/video0 is busy", "video0 is busy"),
        ("GET /api/v1/status says why", "GET /api/v1/status says why"),
        ("use .hdr and/or .exr, 16/9", "use .hdr and/or .exr, 16/9"),
        ("see http://127.0.0.1:8470/panel/", "see http://127.0.0.1:8470/panel/"),
    ],
)
def test_folders_of_this_machine_are_taken_out(text: str, shown: str) -> None:
    assert redact_folders(text) == shown


def test_a_long_body_is_refused_before_it_is_read(client: Client) -> None:
    async def never() -> AsyncIterator[bytes]:
        raise AssertionError("the body was read")
        yield b""

    headers = {"content-type": "application/json", "content-length": str(MAX_JSON_BYTES + 1)}
    check_problem(client.request("PUT", "/api/v1/lighting", content=never(), headers=headers), 413)
    headers = {"content-type": "multipart/form-data; boundary=x", "content-length": str(MAX_UPLOAD_FORM_BYTES + 1)}
    problem = check_problem(client.request("POST", "/api/v1/environments", content=never(), headers=headers), 413)
    assert "67 MB" in problem["what"]


def test_a_long_body_of_unknown_length_is_cut_off(client: Client) -> None:
    taken = 0

    async def endless() -> AsyncIterator[bytes]:
        nonlocal taken
        while True:
            taken += 1 << 16
            yield b" " * (1 << 16)

    headers = {"content-type": "application/json"}
    check_problem(client.request("PUT", "/api/v1/lighting", content=endless(), headers=headers), 413)
    assert taken <= MAX_JSON_BYTES + (2 << 16)


def test_a_form_may_be_longer_than_json(client: Client) -> None:
    answer = client.upload("/api/v1/backgrounds", "big", b"x" * (2 * MAX_JSON_BYTES), "big.png")
    check_problem(answer, 422)


def test_json_that_does_not_say_so_is_refused(app: FastAPI, client: Client) -> None:
    """A form of another site can send text/plain without asking; it must not pass as JSON."""
    answer = client.request("PUT", "/api/v1/mode", content='{"mode": "ratio"}', headers={"content-type": "text/plain"})
    check_problem(answer, 422)
