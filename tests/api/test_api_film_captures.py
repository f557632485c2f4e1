"""Films that are sent, and what is told of the capture."""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from relit_camera.api import streamed_forms
from relit_camera.api.middleware import body_limits
from relit_camera.live.status.film_status import DroppedFrames, FilmOptions, FilmReport, FilmStage
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera

PATH = "/api/v1/captures/film"
FILM = bytes(range(256)) * 9000
"""More than one chunk."""


def send(client: Client, fields: dict[str, str] | None = None, data: bytes = FILM) -> Any:
    return client.post(PATH, data={"name": "me"} | (fields or {}), files={"file": ("evening.mp4", data)})


def test_a_film_is_sent_followed_canceled_and_resumed(client: Client, camera: FakeCamera) -> None:
    idle = client.get(PATH).json()
    assert (idle["stage"], idle["stages"], idle["report"]) == ("idle", [], None)
    answer = send(client, {"light_distance_cm": "80", "balls": "2", "face": "105.5,150,52"})
    assert answer.status_code == 202, answer.text
    begun = answer.json()
    assert (begun["stage"], begun["subject"], begun["film"], begun["progress"]) == ("reading", "me", "evening.mp4", 0.1)
    assert begun["stages"][0] == {"name": "Looking for flashes", "state": "running", "seconds": 1.5}
    assert camera.film_capture.film.read_bytes() == FILM
    assert camera.film_capture.options == FilmOptions(80, balls=2, face=(105.5, 150, 52))
    check_problem(send(client), 409)
    assert client.delete(PATH).json()["stage"] == "canceled"
    assert client.post(f"{PATH}/resume").json()["stage"] == "reading"
    assert camera.film_capture.options.balls == 2
    client.delete(PATH)
    assert client.post(f"{PATH}/resume", json={"focal_px": 800}).status_code == 202
    assert camera.film_capture.options == FilmOptions(focal_px=800)
    assert client.delete(f"{PATH}?forget=true").json()["stage"] == "idle"
    check_problem(client.post(f"{PATH}/resume"), 409)


def test_an_upload_that_is_canceled_ends_at_the_next_piece(client: Client, camera: FakeCamera) -> None:
    begin = (
        b'--limit\r\nContent-Disposition: form-data; name="name"\r\n\r\nme\r\n'
        b'--limit\r\nContent-Disposition: form-data; name="file"; filename="evening.mp4"\r\n\r\n'
    )
    sent: list[int] = []

    async def body() -> AsyncIterator[bytes]:
        yield begin
        for index in range(30):
            sent.append(index)
            if index == 3:
                camera.film_capture.canceled.set()
            yield bytes(streamed_forms.CHUNK_BYTES)
        yield b"\r\n--limit--\r\n"

    answer = client.post(PATH, content=body(), headers={"content-type": "multipart/form-data; boundary=limit"})
    check_problem(answer, 409)
    assert camera.film_capture.written < 6 * streamed_forms.CHUNK_BYTES


def test_an_upload_that_comes_slowly_ends_soon_after_it_is_canceled(client: Client, camera: FakeCamera) -> None:
    sent: list[int] = []

    async def body() -> AsyncIterator[bytes]:
        yield (
            b'--limit\r\nContent-Disposition: form-data; name="name"\r\n\r\nme\r\n'
            b'--limit\r\nContent-Disposition: form-data; name="file"; filename="evening.mp4"\r\n\r\n'
        ) + bytes(streamed_forms.CHUNK_BYTES)
        for index in range(30):
            sent.append(index)
            if index == 3:
                camera.film_capture.canceled.set()
            yield bytes(1000)
        yield b"\r\n--limit--\r\n"

    headers = {"content-type": "multipart/form-data; boundary=limit"}
    check_problem(client.post(PATH, content=body(), headers=headers), 409)
    assert len(sent) < 8


def test_the_report_is_given_whole(client: Client, camera: FakeCamera) -> None:
    report = FilmReport("usable", "the lamp was never low", 120, 0.4, 33.0, 900, 280, (DroppedFrames(12, "weak"),))
    camera.film_capture.current = replace(camera.film_capture.current, stage=FilmStage.DONE, report=report)
    told = client.get(PATH).json()["report"]
    assert told["dropped"] == [{"count": 12, "why": "weak"}]
    assert (told["verdict"], told["because"], told["covered_fraction"]) == ("usable", "the lamp was never low", 0.4)


def test_pictures_of_the_report_are_served(client: Client) -> None:
    assert client.get(f"{PATH}/pictures/studio.jpg").content == b"a JPEG file"
    check_problem(client.get(f"{PATH}/pictures/none.jpg"), 404)


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"name": "../x"}, "name"),
        ({"balls": "3"}, "balls"),
        ({"light_distance_cm": "near"}, "light_distance_cm"),
        ({"face": "1,2"}, "face"),
        ({"size": "2000"}, "size"),
        ({"fresh": "1"}, "fresh"),
    ],
)
def test_wrong_fields_are_named_and_nothing_is_kept(
    client: Client, camera: FakeCamera, fields: dict[str, str], field: str
) -> None:
    problem = check_problem(send(client, fields), 422)
    assert problem["errors"][0]["field"] == field
    assert not camera.film_capture.film.exists()
    assert client.get(PATH).json()["stage"] == "idle"


def parts(*named: tuple[str, str | None, bytes]) -> dict[str, Any]:
    """A form with parts in this order: field, file name, content."""
    body = b""
    for field, file_name, content in named:
        extra = "" if file_name is None else f'; filename="{file_name}"'
        body += f'--xyz\r\nContent-Disposition: form-data; name="{field}"{extra}\r\n\r\n'.encode() + content + b"\r\n"
    return {"content": body + b"--xyz--\r\n", "headers": {"Content-Type": "multipart/form-data; boundary=xyz"}}


@pytest.mark.parametrize(
    ("form", "said"),
    [
        (parts(("file", "a.mp4", b"x"), ("name", None, b"me")), "name"),
        (parts(("name", None, b"me")), "file"),
        (parts(("name", None, b"me"), ("file", None, b"x")), "file"),
        (parts(("name", None, b"me"), ("other", "a.mp4", b"x")), "other"),
        (parts(("name", None, b"me"), ("name", None, b"you"), ("file", "a.mp4", b"x")), "name"),
        (parts(("name", None, b"me" * 4096), ("file", "a.mp4", b"x")), "name"),
    ],
)
def test_a_form_of_another_kind_is_refused(client: Client, camera: FakeCamera, form: Any, said: str) -> None:
    problem = check_problem(client.post(PATH, **form), 422)
    assert problem["errors"][0]["field"] == said
    assert not camera.film_capture.film.exists()


def test_an_empty_film_a_broken_form_and_no_form_are_told(client: Client, camera: FakeCamera) -> None:
    assert "empty" in check_problem(send(client, data=b""), 422)["what"]
    whole = parts(("name", None, b"me"), ("file", "a.mp4", b"film"))
    check_problem(client.post(PATH, **(whole | {"content": whole["content"][:-12]})), 400)
    check_problem(client.post(PATH, **(whole | {"content": b"no form at all"})), 400)
    check_problem(client.post(PATH, json={"name": "me"}), 415)
    check_problem(client.post(PATH), 415)
    assert not camera.film_capture.film.exists()
    assert client.get(PATH).json()["stage"] == "idle"


def test_a_film_that_is_too_large_is_refused(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(body_limits.STREAMED_FORMS, PATH, 1 << 20)
    check_problem(send(client), 413)
    assert not camera.film_capture.film.exists()


@pytest.mark.parametrize("announced", [True, False])
def test_a_film_for_which_the_disk_has_too_little_room_is_refused(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch, announced: bool
) -> None:
    class Usage:
        free = 1 << 20

    monkeypatch.setattr(streamed_forms, "disk_usage", lambda path: Usage)
    whole = parts(("name", None, b"me"), ("file", "a.mp4", FILM))

    async def pieces() -> Any:
        yield whole["content"]

    answer = client.post(PATH, **(whole if announced else whole | {"content": pieces()}))
    check_problem(answer, 507 if announced else 413)
    assert not camera.film_capture.film.exists()


def test_a_large_film_is_not_held_in_memory(client: Client, camera: FakeCamera, tmp_path: Path) -> None:
    import tracemalloc

    piece = bytes(1 << 20)

    async def pieces() -> Any:
        yield b'--xyz\r\nContent-Disposition: form-data; name="name"\r\n\r\nme\r\n'
        yield b'--xyz\r\nContent-Disposition: form-data; name="file"; filename="a.mp4"\r\n\r\n'
        for _ in range(100):
            yield piece
        yield b"\r\n--xyz--\r\n"

    tracemalloc.start()
    try:
        answer = client.post(PATH, content=pieces(), headers={"Content-Type": "multipart/form-data; boundary=xyz"})
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert answer.status_code == 202, answer.text
    assert camera.film_capture.film.stat().st_size == 100 << 20
    assert peak < 32 << 20
