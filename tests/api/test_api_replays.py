"""Videos that are sent to be relit."""

from __future__ import annotations

from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera

PATH = "/api/v1/replays"


def test_a_video_is_sent_followed_watched_and_deleted(client: Client, camera: FakeCamera) -> None:
    assert client.get(PATH).json() == []
    answer = client.upload(PATH, "my talk", b"a video", "talk.mp4")
    assert answer.status_code == 202, answer.text
    assert (answer.json()["name"], answer.json()["stage"], answer.json()["video"]) == ("my talk", "working", None)
    check_problem(client.upload(PATH, "other", b"a video", "talk.mp4"), 409)
    check_problem(client.get(f"{PATH}/my talk/video"), 409)
    check_problem(client.get(f"{PATH}/other/video"), 404)
    camera.replays.finish("my talk")
    assert [each["stage"] for each in client.get(PATH).json()] == ["done"]
    done = client.get(f"{PATH}/my talk").json()
    assert client.get(done["video"]).content == b"a video"
    part = client.get(done["video"], headers={"Range": "bytes=2-4"})
    assert (part.status_code, part.content) == (206, b"vid")
    check_problem(client.upload(PATH, "my talk", b"a video", "talk.mp4"), 409)
    assert client.delete(f"{PATH}/my talk").status_code == 204
    check_problem(client.get(f"{PATH}/my talk"), 404)
    check_problem(client.delete(f"{PATH}/my talk"), 404)


def test_what_is_no_name_or_no_form_is_a_problem(client: Client) -> None:
    check_problem(client.upload(PATH, "../x", b"a video", "talk.mp4"), 422)
    check_problem(client.post(PATH, json={"name": "x"}), 415)
    check_problem(client.post(PATH, data={"name": "x"}, files={"film": ("a.mp4", b"x")}), 422)


def test_a_video_and_a_film_are_not_worked_on_at_once(client: Client, camera: FakeCamera) -> None:
    film = "/api/v1/captures/film"
    assert client.upload(film, "me", b"a film", "me.mp4").status_code == 202
    check_problem(client.upload(PATH, "talk", b"a video", "talk.mp4"), 409)
    client.delete(film)
    assert client.upload(PATH, "talk", b"a video", "talk.mp4").status_code == 202
    check_problem(client.post(f"{film}/resume"), 409)
    check_problem(client.upload(film, "me", b"a film", "me.mp4"), 409)
