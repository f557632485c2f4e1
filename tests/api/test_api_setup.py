"""Checks, devices, source, tracker, models and framing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from relit_camera.devices.sinks.sink import Readers
from relit_camera.live.status.setup_status import SpeedAdvice
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera


def test_checks_have_commands_to_copy(client: Client) -> None:
    failed, fine = client.get("/api/v1/checks").json()
    assert failed == {
        "id": "kernel-module",
        "title": "Kernel module",
        "state": "failed",
        "what": "it is not loaded",
        "cure": "run: sudo modprobe v4l2loopback",
        "commands": ["sudo modprobe v4l2loopback"],
    }
    assert (fine["state"], fine["commands"]) == ("ok", [])


def test_devices_have_sizes_and_rates(client: Client) -> None:
    found = client.get("/api/v1/devices").json()
    (webcam,), (virtual,) = found["webcams"], found["virtual_cameras"]
    assert webcam["sizes"] == [{"width": 1280, "height": 720, "rates": [30.0, 15.0]}]
    assert (webcam["in_use_by"], webcam["is_current"]) == (["firefox"], True)
    assert virtual == {"device": "/dev/video10", "name": "Relit Camera", "is_current": True}


def test_only_what_is_given_changes_of_the_source(client: Client) -> None:
    before = client.get("/api/v1/source").json()
    changed = client.patch("/api/v1/source", {"width": 640, "height": 360}).json()
    assert changed == before | {"width": 640, "height": 360}
    assert client.get("/api/v1/source").json() == changed


def test_a_source_that_cannot_be_opened_is_a_problem_with_a_cure(client: Client) -> None:
    problem = check_problem(client.patch("/api/v1/source", {"device": "busy"}), 409)
    assert problem["cure"] == "close the program that uses it"
    check_problem(client.patch("/api/v1/source", {"device": "/etc/passwd"}), 404)


@pytest.mark.parametrize(
    "body",
    [{"width": 641}, {"width": 0}, {"fps": 0}, {"fps": 1000}, {"device": ""}, {"size": 3}, {"height": "tall"}, []],
)
def test_a_wrong_change_of_the_source_changes_nothing(client: Client, body: object) -> None:
    before = client.get("/api/v1/source").json()
    check_problem(client.patch("/api/v1/source", body), 422)
    assert client.get("/api/v1/source").json() == before


def test_a_tracker_needs_its_models_which_are_pulled_on_request_alone(client: Client, camera: FakeCamera) -> None:
    assert client.get("/api/v1/tracker").json() == {"name": "mesh", "names": ["mesh", "openseeface"]}
    check_problem(client.put("/api/v1/tracker", {"name": "openseeface"}), 409)
    assert client.get("/api/v1/models").json()["stage"] == "idle"
    answer = client.post("/api/v1/models")
    assert (answer.status_code, answer.json()["stage"], answer.json()["progress"]) == (202, "pulling", 0.25)
    check_problem(client.post("/api/v1/models"), 409)
    assert client.delete("/api/v1/models").json()["stage"] == "canceled"
    camera.setup.pull = replace(camera.setup.pull, missing=())
    assert client.put("/api/v1/tracker", {"name": "openseeface"}).json()["name"] == "openseeface"
    check_problem(client.put("/api/v1/tracker", {"name": "none"}), 404)


def test_framing_is_told_to_whoever_asks(client: Client, camera: FakeCamera) -> None:
    assert client.get("/api/v1/framing").json()["distance"] == {"state": "good", "advice": ""}
    assert client.put("/api/v1/framing", {"wanted": True}).json() == {"wanted": True}
    assert camera.setup.framing_wanted
    camera.setup.seen = None
    check_problem(client.get("/api/v1/framing"), 503)
    check_problem(client.put("/api/v1/framing", {"wanted": "perhaps"}), 422)


def test_the_status_has_readers_new_pictures_and_advice(client: Client, camera: FakeCamera) -> None:
    status = client.get("/api/v1/status").json()
    assert status["readers"] == {"count": None, "names": []}
    assert status["fps"]["new"] == 29.7
    assert status["advice"] is None
    advice = SpeedAdvice("too slow", "try 640x360", 640, 360)
    camera.base = replace(camera.base, readers=Readers(1, ("firefox",)), advice=advice)
    status = client.get("/api/v1/status").json()
    assert status["readers"] == {"count": 1, "names": ["firefox"]}
    assert "relit_readers 1.0" in client.get("/metrics").text
    assert status["advice"] == {"what": "too slow", "cure": "try 640x360", "width": 640, "height": 360}
