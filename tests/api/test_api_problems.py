"""Errors that belong to no operation, and what problems must not tell."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest
from fastapi import FastAPI

from relit_camera.api.middleware.body_limits import MAX_JSON_BYTES, MAX_UPLOAD_FORM_BYTES
from relit_camera.api.problem_details import problem_response_from, status_for_error
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
        ("POST", "presets/evening", "GET, PUT, PATCH, DELETE"),
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
    answer = client.request("PUT", "/api/v1/mode", content='{"mode": "live"}', headers={"content-type": "text/plain"})
    assert "application/json" in check_problem(answer, 415)["cure"]


@pytest.mark.parametrize("path", ["mode", "scene", "presets/look"])
def test_a_body_without_a_content_type_is_refused(client: Client, path: str) -> None:
    method = "PATCH" if path == "scene" else "PUT"
    check_problem(client.request(method, f"/api/v1/{path}", content='{"mode": "live"}'), 415)


def test_a_body_may_be_left_out_without_a_content_type(client: Client) -> None:
    assert client.request("PUT", "/api/v1/presets/look").status_code == 201


@pytest.mark.parametrize(
    ("path", "body", "field", "meant"),
    [
        ("lighting", {"yaw_dge": 3}, "yaw_dge", "yaw_deg"),
        ("scene", {"lighting": {"exposure": 3}}, "lighting.exposure", "exposure_ev"),
        ("scene", {"lighting": {"lamps": [{}, {"kelvni": 3000}]}}, "lighting.lamps.1.kelvni", "kelvin"),
        ("scene", {"background": {"kind": "color", "colour": "#112233"}}, "background.color.colour", "color"),
        ("scene", {"zzz": 1}, "zzz", None),
    ],
)
def test_a_misspelt_field_is_offered_right(
    client: Client, path: str, body: object, field: str, meant: str | None
) -> None:
    problem = check_problem(client.patch(f"/api/v1/{path}", body), 422)
    assert problem["errors"][0]["field"] == field
    assert "openapi" not in problem["detail"]
    if meant is None:
        assert "did you mean" not in problem["detail"]
    else:
        assert problem["cure"] == f"did you mean {meant}?"
        assert f"did you mean {meant}?" in problem["errors"][0]["message"]


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("scene", {"frozen": "true"}),
        ("scene", {"unlit_allowed": 1}),
        ("scene", {"lighting": {"yaw_deg": "3"}}),
        ("scene", {"lighting": {"lamps": [{"color": ["1", 0, 0]}]}}),
        ("lighting", {"blend": True}),
    ],
)
def test_a_value_of_another_type_is_refused(client: Client, path: str, body: object) -> None:
    check_problem(client.patch(f"/api/v1/{path}", body), 422)


def test_a_whole_number_may_be_written_with_a_point(client: Client) -> None:
    assert client.put("/api/v1/captures/desk/shown", {"step": 3.0}).status_code == 200
    for step in (3.5, "3", True):
        check_problem(client.put("/api/v1/captures/desk/shown", {"step": step}), 422)
