"""Stored environments."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
from relit_camera.light.environments.environment_panorama import Environment
from tests.api.api_client import Client, check_problem, decoded_picture, hdr, png
from tests.api.fake_camera import FakeCamera
from tests.app.subject_builders import captured
from tests.generated_subject import small_subject
from tests.small_camera import difference

ENVIRONMENTS = "/api/v1/environments"


def test_the_built_in_ones_are_listed(client: Client) -> None:
    listed = client.get(ENVIRONMENTS).json()
    assert [item["name"] for item in listed] == list(BUILTIN_NAMES)
    assert all(item["builtin"] and not item["temporary"] for item in listed)
    assert [item["name"] for item in listed if item["is_current"]] == ["studio"]


def test_a_panorama_is_stored_used_and_deleted(client: Client, camera: FakeCamera) -> None:
    answer = client.upload(ENVIRONMENTS, "my room", hdr(), "IMG 1.HDR")
    assert answer.status_code == 201, answer.text
    details = answer.json()
    assert (details["width"], details["height"], details["builtin"], details["notes"]) == (64, 32, False, [])
    assert client.get(f"{ENVIRONMENTS}/my room").json() == details
    assert client.get(ENVIRONMENTS).json()[-1]["name"] == "my room"

    assert client.patch("/api/v1/lighting", {"environment": "my room"}).status_code == 200
    assert camera.scene_controller.scene.environment is not None
    assert camera.scene_controller.scene.environment.name == "my room"
    check_problem(client.delete(f"{ENVIRONMENTS}/my room"), 409)

    client.patch("/api/v1/lighting", {"environment": None})
    assert client.delete(f"{ENVIRONMENTS}/my room").status_code == 204
    check_problem(client.get(f"{ENVIRONMENTS}/my room"), 404)
    check_problem(client.delete(f"{ENVIRONMENTS}/my room"), 404)


def test_clipped_highlights_are_said(client: Client) -> None:
    details = client.upload(ENVIRONMENTS, "white", png(64, 32, 255), "white.png").json()
    assert details["clipped_fraction"] == pytest.approx(1)
    assert "clipped" in details["notes"][0]


def test_thumbnails_are_kept_by_clients(client: Client) -> None:
    first = client.get(f"{ENVIRONMENTS}/studio/thumbnail.jpg")
    picture = decoded_picture(first.content)
    assert picture.shape == (128, 256, 3)
    assert picture.std() > 10
    known = {"if-none-match": f'"other", W/{first.headers["etag"]}'}
    again = client.get(f"{ENVIRONMENTS}/studio/thumbnail.jpg", headers=known)
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == first.headers["etag"]
    assert "no-store" not in first.headers["cache-control"]


def test_a_file_of_this_run_is_listed_but_not_stored(client: Client, camera: FakeCamera, tmp_path: Path) -> None:
    path = tmp_path / "guest room.hdr"
    path.write_bytes(hdr())
    name = camera.scene_controller.register_temporary_environment(str(path))
    item = client.get(ENVIRONMENTS).json()[-1]
    assert (item["name"], item["temporary"], item["builtin"]) == (name, True, False)
    assert client.get(item["thumbnail"]).headers["content-type"] == "image/jpeg"
    assert client.get(f"{ENVIRONMENTS}/{name}").json()["width"] == 64
    assert client.patch("/api/v1/lighting", {"environment": name}).status_code == 200
    check_problem(client.upload(ENVIRONMENTS, name, hdr(), "other.hdr"), 409)


@pytest.mark.parametrize("name", ["studio", "background"])
def test_a_taken_name_is_in_conflict(client: Client, name: str) -> None:
    check_problem(client.upload(ENVIRONMENTS, name, hdr(), "a.hdr"), 409)


def test_the_built_in_ones_stay(client: Client) -> None:
    problem = check_problem(client.delete(f"{ENVIRONMENTS}/sunset"), 409)
    assert "built in" in problem["what"]


def nan_panorama() -> bytes:
    radiance = np.full((8, 16, 3), np.nan, np.float32)
    return bytes(cv2.imencode(".tiff", radiance)[1])


@pytest.mark.parametrize(
    ("data", "file_name"),
    [
        (b"", "empty.hdr"),
        (b"#?RADIANCE\nnothing", "broken.hdr"),
        (hdr()[:200], "truncated.hdr"),
        (png(32, 32), "square.png"),
        (png(64, 32, 0), "black.png"),
        (png(), "panorama.txt"),
        (png(), "panorama"),
        (nan_panorama(), "nan.exr"),
    ],
)
def test_what_cannot_light_is_refused_and_leaves_nothing(
    client: Client, tmp_path: Path, data: bytes, file_name: str
) -> None:
    problem = check_problem(client.upload(ENVIRONMENTS, "bad", data, file_name), 422)
    assert problem["cure"]
    assert str(tmp_path) not in problem["detail"]
    assert "/tmp" not in problem["detail"]
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("name", ["nowhere", "studi"])
def test_unknown_names_are_not_found(client: Client, name: str) -> None:
    check_problem(client.get(f"{ENVIRONMENTS}/{name}"), 404)
    check_problem(client.get(f"{ENVIRONMENTS}/{name}/thumbnail.jpg"), 404)


def test_a_name_that_is_no_name_is_refused(client: Client) -> None:
    check_problem(client.get(f"{ENVIRONMENTS}/.hidden"), 422)
    check_problem(client.get(f"{ENVIRONMENTS}/%2e%2e%2f%2e%2e%2fetc"), 404)


@pytest.mark.slow
def test_a_place_on_the_person_who_is_shown(client: Client, camera: FakeCamera) -> None:
    path = f"{ENVIRONMENTS}/sunset/on-me.jpg"
    check_problem(client.get(path), 404)
    camera.scene_controller.show_subject("small", small_subject())
    first = client.get(path)
    picture = decoded_picture(first.content)
    assert picture.shape == (192, 256, 3)
    assert client.get(path, headers={"if-none-match": first.headers["etag"]}).status_code == 304
    other = decoded_picture(client.get(f"{ENVIRONMENTS}/party/on-me.jpg").content)
    middle = (slice(60, 130), slice(100, 156))
    assert difference(picture[middle], other[middle]) > 5  # the person's light too, not only the place
    check_problem(client.get(f"{ENVIRONMENTS}/nowhere/on-me.jpg"), 404)
    assert client.get(path).content == first.content


@pytest.mark.slow
def test_other_pictures_do_not_wait_for_one_that_is_made_in_the_background(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera.scene_controller.show_subject("small", small_subject())
    begun, goes_on = threading.Event(), threading.Event()
    load = camera.scene_controller.environments.load

    def held_up(name: str) -> Environment:
        if name == "window":  # as by programs that take all cores, for its thread has a low priority
            begun.set()
            assert goes_on.wait(30)
        return load(name)

    monkeypatch.setattr(camera.scene_controller.environments, "load", held_up)
    with ThreadPoolExecutor(1) as other:
        made = other.submit(client.get, f"{ENVIRONMENTS}/window/on-me.jpg")
        try:
            assert begun.wait(30)
            assert client.get(f"{ENVIRONMENTS}/party/thumbnail.jpg").status_code == 200
            assert not made.done()
        finally:
            goes_on.set()
        assert made.result().status_code == 200


@pytest.mark.slow
def test_another_person_has_other_pictures(client: Client, camera: FakeCamera) -> None:
    camera.scene_controller.show_subject("small", small_subject())
    client.upload(ENVIRONMENTS, "room", hdr(), "room.hdr")
    one = client.get(f"{ENVIRONMENTS}/room/on-me.jpg").content
    camera.scene_controller.show_subject("other", captured("film"))
    assert client.get(f"{ENVIRONMENTS}/room/on-me.jpg").content != one
    camera.scene_controller.environments.remove("room")
    client.upload(ENVIRONMENTS, "room", hdr(128, 64), "room.hdr")
    assert client.get(f"{ENVIRONMENTS}/room/on-me.jpg").content != one
