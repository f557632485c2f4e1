"""The whole scene in one call: read, changed under a condition, undone, done again, reset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from relit_camera.api.routes.whole_scene import matching_revisions
from relit_camera.subject.subject_file import write_subject
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera
from tests.generated_subject import small_subject

SCENE = "/api/v1/scene"


@pytest.fixture
def ada(camera: FakeCamera) -> str:
    """The name of a stored subject."""
    path = camera.scene_controller.subjects.new_path("ada")
    write_subject(path, small_subject())
    return path.stem


def patch(client: Client, if_match: str | None = None, **changes: object) -> dict[str, Any]:
    headers = {} if if_match is None else {"If-Match": if_match}
    answer = client.request("PATCH", SCENE, json=changes, headers=headers)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_it_is_read_with_its_revision(client: Client, camera: FakeCamera) -> None:
    answer = client.get(SCENE)
    body = answer.json()
    assert answer.headers["etag"] == f'"{camera.scene_controller.scene.revision}"' == f'"{body["revision"]}"'
    assert (body["mode"], body["subject"], body["can_undo"]) == ("live", None, False)


def test_everything_changes_in_one_revision(client: Client, camera: FakeCamera, ada: str) -> None:
    before = camera.scene_controller.scene.revision
    changes: dict[str, Any] = {
        "lighting": {"yaw_deg": 20, "lamps": [{"kelvin": 3000, "name": "key", "muted": True}]},
        "background": {"kind": "color", "color": "#112233"},
        "mode": "portrait",
        "subject": ada,
        "frozen": True,
    }
    body = patch(client, **changes)
    assert body["revision"] == before + 1
    assert (body["mode"], body["subject"], body["frozen"]) == ("portrait", "ada", True)
    assert body["background"] == changes["background"]
    assert (body["lighting"]["yaw_deg"], body["lighting"]["environment"]) == (20, "studio")
    assert body["lighting"]["lamps"][0]["name"] == "key"
    assert patch(client, subject=None)["subject"] is None


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"subject": "nobody"}, 404),
        ({"lighting": {"environment": "nowhere"}}, 404),
        ({"lighting": {"environment": "background"}}, 422),
        ({"background": {"kind": "image", "image": "none"}}, 404),
        ({"lighting": {"yaw_deg": 1000}}, 422),
        ({"lighting": None}, 422),
    ],
)
def test_what_is_wrong_in_part_changes_nothing(
    client: Client, camera: FakeCamera, changes: dict[str, Any], status: int
) -> None:
    scene = camera.scene_controller.scene
    check_problem(client.patch(SCENE, {"mode": "portrait", "frozen": True, **changes}), status)
    assert camera.scene_controller.scene is scene


def test_a_change_of_another_scene_is_refused(client: Client, camera: FakeCamera) -> None:
    tag = client.get(SCENE).headers["etag"]
    patch(client, tag, mode="portrait")
    answer = client.request("PATCH", SCENE, json={"frozen": True}, headers={"If-Match": tag})
    problem = check_problem(answer, 412)
    assert problem["type"].endswith(":precondition-failed")
    assert not camera.scene_controller.scene.frozen
    assert patch(client, "*", frozen=True)["frozen"]
    assert not patch(client, f'"0", {client.get(SCENE).headers["etag"]}', frozen=False)["frozen"]


@pytest.mark.parametrize(
    ("header", "revisions"), [("*", None), ('"17"', {17}), ('"1", "2"', {1, 2}), ('W/"3"', set()), ("x", set())]
)
def test_revisions_of_a_condition(header: str, revisions: set[int] | None) -> None:
    assert matching_revisions(header) == revisions


def test_steps_are_undone_and_done_again(client: Client, ada: str) -> None:
    problem = check_problem(client.post(f"{SCENE}/undo"), 409)
    assert "nothing to undo" in problem["what"]
    patch(client, subject=ada)
    patch(client, lighting={"environment": "sunset"}, mode="portrait")
    undone = client.post(f"{SCENE}/undo").json()
    assert (undone["lighting"]["environment"], undone["mode"], undone["subject"]) == ("studio", "live", "ada")
    assert (undone["can_undo"], undone["can_redo"]) == (True, True)
    assert client.post(f"{SCENE}/undo").json()["subject"] is None
    assert client.post(f"{SCENE}/redo").json()["subject"] == "ada"
    again = client.post(f"{SCENE}/redo").json()
    assert (again["lighting"]["environment"], again["can_redo"]) == ("sunset", False)
    check_problem(client.post(f"{SCENE}/redo"), 409)


def test_changes_of_the_same_fields_at_once_are_one_step(client: Client) -> None:
    for yaw in range(5):
        patch(client, lighting={"yaw_deg": yaw})
    client.patch("/api/v1/lighting", {"exposure_ev": 1})
    assert client.post(f"{SCENE}/undo").json()["lighting"]["yaw_deg"] == 4
    undone = client.post(f"{SCENE}/undo").json()
    assert (undone["lighting"]["yaw_deg"], undone["can_undo"]) == (0, False)


def test_reset_shows_what_the_settings_say_and_can_be_undone(client: Client, camera: FakeCamera, ada: str) -> None:
    camera.scene_controller.mark_start()
    patch(client, subject=ada, mode="portrait", frozen=True, lighting={"yaw_deg": 30})
    body = client.post(f"{SCENE}/reset").json()
    assert (body["lighting"]["yaw_deg"], body["mode"], body["frozen"]) == (0, "live", False)
    assert body["subject"] == "ada"  # the settings name nobody: whoever is shown stays
    assert client.post(f"{SCENE}/undo").json()["mode"] == "portrait"


def test_what_is_gone_is_said_and_does_not_bar_the_way(client: Client, camera: FakeCamera, ada: str) -> None:
    patch(client, mode="portrait")
    patch(client, subject=ada)
    patch(client, frozen=True, mode="live")
    patch(client, subject=None)
    camera.scene_controller.subjects.remove(ada)
    check_problem(client.post(f"{SCENE}/undo"), 404)
    check_problem(client.post(f"{SCENE}/undo"), 404)
    assert client.post(f"{SCENE}/undo").json()["mode"] == "portrait"


# Nothing as filmed unasked


@pytest.mark.parametrize("change", [{"split": 0.5}, {"split": 1}, {"blend": 0}, {"blend": 0.01}])
@pytest.mark.parametrize("way", ["scene", "lighting", "preset"])
def test_nothing_as_filmed_without_a_confirmed_choice(
    client: Client, camera: FakeCamera, change: dict[str, float], way: str
) -> None:
    patch(client, mode="live")
    scene = camera.scene_controller.scene
    if way == "preset":
        client.put("/api/v1/presets/before", {"mode": "live", "lighting": change})
        answer = client.post("/api/v1/presets/before/apply")
    else:
        body = {"lighting": change} if way == "scene" else change
        answer = client.patch(f"/api/v1/{way}", body)
    problem = check_problem(answer, 409)
    assert problem["type"].endswith(":unlit-not-allowed")
    assert "unlit_allowed" in problem["cure"]
    assert camera.scene_controller.scene is scene
    assert patch(client, lighting=change, unlit_allowed=True)["unlit_allowed"]


def test_neither_the_mode_nor_nobody_brings_it_about(client: Client, camera: FakeCamera) -> None:
    patch(client, mode="portrait", lighting={"blend": 0})  # the source image as captured
    check_problem(client.put("/api/v1/mode", {"mode": "live"}), 409)
    client.put("/api/v1/subject", {"name": None})
    assert not camera.scene_controller.scene.unlit_allowed


def test_when_the_choice_is_withdrawn_nothing_as_filmed_stays(client: Client) -> None:
    patch(client, mode="live", lighting={"split": 0.5, "yaw_deg": 5}, unlit_allowed=True)
    body = patch(client, unlit_allowed=False)
    assert (body["lighting"]["split"], body["lighting"]["yaw_deg"], body["unlit_allowed"]) == (0, 5, False)
    check_problem(client.patch(SCENE, {"unlit_allowed": False, "lighting": {"split": 1}}), 409)


def test_undo_redo_and_reset_never_allow_it(client: Client) -> None:
    patch(client, mode="live", lighting={"split": 0.5}, unlit_allowed=True)
    patch(client, lighting={"yaw_deg": 5})
    patch(client, unlit_allowed=False)
    for way in ("undo", "undo", "redo", "redo", "reset"):
        body = client.post(f"{SCENE}/{way}").json()
        assert (body["lighting"]["split"], body["unlit_allowed"]) == (0, False), way


# Nobody else moves a portrait unasked


def test_a_person_can_let_others_move_the_portrait_of_one_subject(client: Client, camera: FakeCamera, ada: str) -> None:
    assert not patch(client, subject=ada, mode="portrait")["avatar_allowed"]
    assert patch(client, avatar_allowed=True)["avatar_allowed"]
    assert camera.scene_controller.scene.avatar_allowed
    assert patch(client, lighting={"yaw_deg": 5})["avatar_allowed"]
    client.put("/api/v1/subject", {"name": None})
    assert not client.get(SCENE).json()["avatar_allowed"]
    assert patch(client, subject=ada, avatar_allowed=True)["avatar_allowed"]
    assert not patch(client, avatar_allowed=False)["avatar_allowed"]
    check_problem(client.patch(SCENE, {"avatar_allowed": 1}), 422)


def test_a_file_named_on_the_command_line_can_be_chosen_again(
    client: Client, camera: FakeCamera, tmp_path: Path, ada: str
) -> None:
    path = tmp_path / "me.relit"
    write_subject(path, small_subject())
    camera.scene_controller.load_configured_subject(str(path))
    client.put("/api/v1/subject", {"name": None})
    items = {item["name"]: item for item in client.get("/api/v1/subjects").json()}
    assert (items["me"]["temporary"], items["ada"]["temporary"]) == (True, False)
    assert client.get(items["me"]["thumbnail"]).headers["content-type"] == "image/jpeg"
    assert patch(client, subject="me")["subject"] == "me"
    check_problem(client.patch(SCENE, {"subject": str(path)}), 422)
    check_problem(client.patch(SCENE, {"subject": ".."}), 404)
