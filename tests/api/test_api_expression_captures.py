"""Expression stills over the API: filmed, from a video, canceled, refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from relit_camera.base.errors import ConflictError
from relit_camera.live.status.expression_status import ExpressionReport, ExpressionStage
from relit_camera.live.status.replay_status import ReplayStage, ReplayStatus
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera

PATH = "/api/v1/captures/expressions"
VIDEO = bytes(range(256)) * 9000
"""More than one chunk."""


def send(client: Client, fields: dict[str, str] | None = None, name: str = "talk.mp4", data: bytes = VIDEO) -> Any:
    return client.post(f"{PATH}/video", data=fields or {}, files={"file": (name, data)})


def test_a_capture_is_started_followed_and_canceled(client: Client, camera: FakeCamera) -> None:
    assert client.get(PATH).json()["stage"] == "idle"
    answer = client.post(PATH, json={"subject": "bea"})
    assert answer.status_code == 202
    begun = answer.json()
    assert (begun["stage"], begun["subject"], begun["prompt"]) == ("filming", "bea", "neutral")
    assert begun["say"] == "look into the camera"
    assert client.post(PATH, json={}).json()["subject"] == "ada"
    assert client.delete(PATH).json()["stage"] == "canceled"


def test_a_report_says_what_was_taken(client: Client, camera: FakeCamera) -> None:
    report = ExpressionReport(9, ("neutral", "wide mouth"), ("open your mouth wide",), 3_200_000)
    capture = camera.expression_capture
    capture.current = replace(capture.current, stage=ExpressionStage.DONE, report=report)
    assert client.get(PATH).json()["report"] == {
        "stills": 9,
        "covered": ["neutral", "wide mouth"],
        "missing": ["open your mouth wide"],
        "file_bytes": 3_200_000,
    }


def test_a_video_is_sent(client: Client, camera: FakeCamera) -> None:
    answer = send(client, {"subject": "bea"})
    assert answer.status_code == 202, answer.text
    assert (answer.json()["stage"], answer.json()["subject"], answer.json()["film"]) == ("building", "bea", "talk.mp4")
    assert camera.expression_capture.video.read_bytes() == VIDEO
    assert send(client).json()["subject"] == "ada"


def test_what_cannot_be_started_is_a_problem(client: Client, camera: FakeCamera) -> None:
    check_problem(client.post(PATH, json={"subject": "../x"}), 422)
    check_problem(client.post(PATH, json={"name": "bea"}), 422)
    check_problem(send(client, {"subject": "../x"}), 422)
    check_problem(send(client, data=b""), 422)
    camera.expression_capture.error = ConflictError("another capture runs", "wait for its end, or cancel it")
    assert check_problem(client.post(PATH, json={}), 409)["what"] == "another capture runs"
    check_problem(send(client), 409)


def test_no_video_is_taken_while_another_is_relit(client: Client, camera: FakeCamera) -> None:
    camera.replays.found["talk"] = ReplayStatus("talk", ReplayStage.WORKING)
    assert check_problem(send(client), 409)["what"] == "a video is being relit"
    assert client.get(PATH).json()["stage"] == "idle"
