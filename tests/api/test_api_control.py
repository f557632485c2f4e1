"""Mode, freezing, neutral pose."""

from __future__ import annotations

import pytest

from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera


def test_mode_is_changed_and_told(client: Client, camera: FakeCamera) -> None:
    assert client.get("/api/v1/mode").json() == {"mode": "live"}
    assert client.put("/api/v1/mode", {"mode": "portrait"}).json() == {"mode": "portrait"}
    assert client.get("/api/v1/mode").json() == {"mode": "portrait"}
    assert camera.scene_controller.scene.look.mode == "portrait"


@pytest.mark.parametrize(("former", "mode"), [("ratio", "live"), ("reenact", "portrait")])
def test_former_names_of_modes_are_taken(client: Client, former: str, mode: str) -> None:
    assert client.put("/api/v1/mode", {"mode": former}).json() == {"mode": mode}
    assert client.patch("/api/v1/scene", {"mode": former}).json()["mode"] == mode
    assert client.put("/api/v1/presets/before", {"mode": former}).status_code == 201
    assert client.get("/api/v1/presets/before").json()["mode"] == mode


def test_freeze_is_changed_and_told(client: Client, camera: FakeCamera) -> None:
    assert client.get("/api/v1/freeze").json() == {"frozen": False}
    assert client.put("/api/v1/freeze", {"frozen": True}).json() == {"frozen": True}
    assert camera.scene_controller.scene.frozen
    assert client.get("/api/v1/status").json()["state"] == "frozen"
    assert client.put("/api/v1/freeze", {"frozen": False}).json() == {"frozen": False}


def test_neutral_pose_is_asked_for(client: Client, camera: FakeCamera) -> None:
    answer = client.post("/api/v1/neutral-pose")
    assert (answer.status_code, answer.content) == (202, b"")
    assert camera.neutral_resets == 1


@pytest.mark.parametrize(
    ("path", "body", "field"),
    [
        ("mode", {"mode": "disco"}, "mode"),
        ("mode", {}, "mode"),
        ("mode", {"mode": "portrait", "speed": 1}, "speed"),
        ("freeze", {"frozen": "perhaps"}, "frozen"),
        ("freeze", None, ""),
    ],
)
def test_bad_bodies_name_their_field(client: Client, path: str, body: object, field: str) -> None:
    problem = check_problem(client.put(f"/api/v1/{path}", body), 422)
    assert problem["errors"][0]["field"] == field


@pytest.mark.parametrize(
    "path", ["mode", "freeze", "lighting", "status", "environments", "neutral-pose", "presets/x/apply"]
)
def test_reading_changes_nothing(client: Client, camera: FakeCamera, path: str) -> None:
    before = camera.scene_controller.scene
    client.get(f"/api/v1/{path}")
    client.request("HEAD", f"/api/v1/{path}")
    assert camera.scene_controller.scene is before
    assert camera.neutral_resets == 0


def test_head_answers_as_get_without_a_body(client: Client) -> None:
    head, get = client.request("HEAD", "/api/v1/mode"), client.get("/api/v1/mode")
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["content-length"] == get.headers["content-length"]
