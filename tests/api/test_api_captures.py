"""Captures that run beside the camera."""

from __future__ import annotations

from relit_camera.base.errors import ConflictError
from relit_camera.live.status.capture_status import CaptureStage, CaptureStatus
from relit_camera.live.status.desk_status import DeskPlace
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera


def test_an_instant_capture_is_started_followed_and_canceled(client: Client, camera: FakeCamera) -> None:
    assert client.get("/api/v1/captures/instant").json()["stage"] == "idle"
    answer = client.post("/api/v1/captures/instant", json={"name": "me"})
    assert answer.status_code == 202
    assert answer.json() == {"stage": "filming", "subject": "me", "what": "", "cure": ""}
    assert client.get("/api/v1/captures/instant").json()["stage"] == "filming"
    assert client.delete("/api/v1/captures/instant").json()["stage"] == "canceled"


def test_without_a_name_it_is_called_instant(client: Client, camera: FakeCamera) -> None:
    assert client.post("/api/v1/captures/instant", json={}).json()["subject"] == "instant"


def test_a_failure_has_its_cure(client: Client, camera: FakeCamera) -> None:
    camera.instant_capture.current = CaptureStatus(
        CaptureStage.FAILED, "me", "no face is in the frames", "look at the camera"
    )
    answer = client.get("/api/v1/captures/instant").json()
    assert (answer["what"], answer["cure"]) == ("no face is in the frames", "look at the camera")


def test_what_cannot_be_started_is_a_problem(client: Client, camera: FakeCamera) -> None:
    camera.instant_capture.error = ConflictError("a capture runs already", "wait for its end, or cancel it")
    problem = check_problem(client.post("/api/v1/captures/instant", json={}), 409)
    assert problem["what"] == "a capture runs already"
    check_problem(client.post("/api/v1/captures/instant", json={"name": "../x"}), 422)


PLACE = {"screen_width_cm": 58.5, "screen_height_cm": 34.4, "distance_cm": 60, "camera_up_cm": 18}


def test_a_desk_capture_is_started_shown_and_canceled(client: Client, camera: FakeCamera) -> None:
    assert client.get("/api/v1/captures/desk").json()["stage"] == "idle"
    answer = client.post("/api/v1/captures/desk", json=PLACE | {"one_by_one": True})
    assert answer.status_code == 202
    begun = answer.json()
    assert (begun["stage"], begun["subject"], begun["columns"], begun["rows"]) == ("exposing", "desk", 5, 3)
    assert begun["patches"] == [1.0] * 15
    assert camera.desk_capture.place == DeskPlace(58.5, 34.4, 60, 18, one_by_one=True)
    check_problem(client.post("/api/v1/captures/desk", json=PLACE), 409)
    assert client.put("/api/v1/captures/desk/shown", {"step": -1}).json()["step"] == 0
    shown = client.put("/api/v1/captures/desk/shown", {"step": 0}).json()
    assert (shown["stage"], shown["step"]) == ("filming", 1)
    assert client.delete("/api/v1/captures/desk").json()["stage"] == "canceled"


def test_a_desk_capture_with_wrong_sizes_is_a_problem(client: Client, camera: FakeCamera) -> None:
    for change in ({"distance_cm": 2}, {"screen_width_cm": None}, {"name": "../x"}, {"unknown": 1}):
        check_problem(client.post("/api/v1/captures/desk", json=PLACE | change), 422)
    check_problem(client.put("/api/v1/captures/desk/shown", {"step": "x"}), 422)
    assert camera.desk_capture.place is None


def test_the_page_of_the_desk_capture_warns_first(client: Client) -> None:
    page = client.get("/desk")
    assert page.status_code == 200
    assert page.text.index("epilepsy") < page.text.index('id="start"')
    assert 'id="start" disabled' in page.text
    for file in ("desk.js", "desk.css"):
        assert f"/panel/capture/{file}" in page.text
        assert client.get(f"/panel/capture/{file}").status_code == 200


def test_the_page_of_the_film_capture_warns_first(client: Client) -> None:
    page = client.get("/film")
    assert page.status_code == 200
    assert page.text.index("epilepsy") < page.text.index('id="film-upload"')
    assert 'id="accept" disabled' in page.text
    for file in ("film.js", "film.css"):
        assert f"/panel/capture/{file}" in page.text
        assert client.get(f"/panel/capture/{file}").status_code == 200
