"""The background and its stored pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.api.api_client import Client, check_problem, decoded_picture, png
from tests.api.fake_camera import FakeCamera

BACKGROUND = "/api/v1/background"


@pytest.mark.parametrize(
    ("body", "stands"),
    [
        ({"kind": "none"}, {"kind": "none"}),
        ({"kind": "blur"}, {"kind": "blur", "strength": 0.5}),
        ({"kind": "color", "color": "#0a1B2c"}, {"kind": "color", "color": "#0a1B2c"}),
        ({"kind": "environment", "blur": 0}, {"kind": "environment", "height_deg": 35.0, "blur": 0.0}),
        ({"kind": "image", "image": "studio"}, {"kind": "image", "image": "studio"}),
    ],
)
def test_each_kind_takes_its_own_fields(client: Client, body: object, stands: object) -> None:
    assert client.put(BACKGROUND, body).json() == stands
    assert client.get(BACKGROUND).json() == stands


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"kind": "rainbow"}, ""),
        ({}, ""),
        ({"kind": "blur", "strength": 0}, "blur.strength"),
        ({"kind": "blur", "color": "#000000"}, "blur.color"),
        ({"kind": "color", "color": "red"}, "color.color"),
        ({"kind": "image"}, "image.image"),
    ],
)
def test_bad_backgrounds_name_their_field(client: Client, camera: FakeCamera, body: object, field: str) -> None:
    before = camera.scene_controller.scene
    problem = check_problem(client.put(BACKGROUND, body), 422)
    assert problem["errors"][0]["field"] == field
    assert camera.scene_controller.scene is before


def test_unknown_picture_is_not_found(client: Client) -> None:
    problem = check_problem(client.put(BACKGROUND, {"kind": "image", "image": "beach"}), 404)
    assert "beach" in problem["what"]


def test_a_picture_is_stored_shown_and_deleted(client: Client, camera: FakeCamera) -> None:
    answer = client.upload("/api/v1/backgrounds", "my beach", png(640, 360, 200), "beach.png")
    assert answer.status_code == 201
    item = answer.json()
    assert item == {
        "name": "my beach",
        "is_current": False,
        "thumbnail": "/api/v1/backgrounds/my%20beach/thumbnail.jpg",
    }
    assert client.get("/api/v1/backgrounds").json() == [item]

    thumbnail = client.get(item["thumbnail"])
    assert thumbnail.headers["content-type"] == "image/jpeg"
    assert decoded_picture(thumbnail.content).shape == (180, 320, 3)
    again = client.get(item["thumbnail"], headers={"if-none-match": thumbnail.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")

    assert client.put(BACKGROUND, {"kind": "image", "image": "my beach"}).status_code == 200
    assert camera.scene_controller.scene.background_image is not None
    assert abs(int(camera.scene_controller.scene.background_image.mean()) - 200) <= 1
    problem = check_problem(client.delete("/api/v1/backgrounds/my beach"), 409)
    assert "in use" in problem["what"]

    client.put(BACKGROUND, {"kind": "none"})
    assert client.delete("/api/v1/backgrounds/my beach").status_code == 204
    assert client.get("/api/v1/backgrounds").json() == []
    check_problem(client.get(item["thumbnail"]), 404)
    check_problem(client.delete("/api/v1/backgrounds/my beach"), 404)


@pytest.mark.parametrize("name", ["studio", "beach"])
def test_a_taken_name_is_in_conflict(client: Client, name: str) -> None:
    client.upload("/api/v1/backgrounds", "beach", png(), "a.png")
    check_problem(client.upload("/api/v1/backgrounds", name, png(), "b.png"), 409)


@pytest.mark.parametrize("data", [b"", b"no picture at all", png()[:60]])
def test_what_is_no_picture_is_refused_and_leaves_nothing(client: Client, tmp_path: Path, data: bytes) -> None:
    check_problem(client.upload("/api/v1/backgrounds", "beach", data, "beach.png"), 422)
    assert client.get("/api/v1/backgrounds").json() == []
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("name", ["../up", ".hidden", "a/b", "", "x" * 65])
def test_a_name_that_is_no_name_is_refused(client: Client, name: str) -> None:
    problem = check_problem(client.upload("/api/v1/backgrounds", name, png(), "a.png"), 422)
    assert problem["errors"][0]["field"] == "name"


def test_a_form_without_a_file_is_refused(client: Client) -> None:
    problem = check_problem(client.post("/api/v1/backgrounds", data={"name": "beach"}), 422)
    assert problem["errors"][0]["field"] == "file"
