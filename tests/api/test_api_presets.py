"""Stored looks."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from relit_camera.base.config.look import ColorBackground, Lamp, Lighting, Mode, Preset
from relit_camera.base.config.preset_store import PresetStore
from relit_camera.base.errors import ConflictError, InputError, NotFoundError
from relit_camera.subject.subject_file import write_subject
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera
from tests.generated_subject import small_subject

PRESETS = "/api/v1/presets"
LOOK = Preset(
    lighting=Lighting(environment="sunset", yaw_deg=-40, lamps=(Lamp(color=(1, 0.5, 0.25)),)),
    background=ColorBackground(color="#112233"),
    mode=Mode.PORTRAIT,
)


def test_a_look_is_stored_listed_applied_and_deleted(client: Client, camera: FakeCamera) -> None:
    body = LOOK.model_dump(mode="json")
    first = client.put(f"{PRESETS}/Late evening", body)
    assert (first.status_code, first.json()) == (201, body)
    assert client.put(f"{PRESETS}/Late evening", body).status_code == 200
    assert client.get(PRESETS).json() == [{"name": "Late evening", "at_start": False}]
    assert client.get(f"{PRESETS}/Late evening").json() == body

    assert client.post(f"{PRESETS}/Late evening/apply").json() == LOOK.look.model_dump(mode="json")
    assert camera.scene_controller.scene.look == LOOK.look

    assert client.delete(f"{PRESETS}/Late evening").status_code == 204
    assert client.get(PRESETS).json() == []


def test_without_a_body_the_present_look_is_stored(client: Client, camera: FakeCamera) -> None:
    camera.scene_controller.set_look(LOOK.look)
    assert client.request("PUT", f"{PRESETS}/now").json() == LOOK.model_dump(mode="json")
    assert PresetStore(camera.scene_controller.backgrounds.folder.parent / "presets").load("now") == LOOK


@pytest.mark.parametrize(("method", "path"), [("GET", ""), ("DELETE", ""), ("POST", "/apply")])
def test_unknown_names_are_not_found(client: Client, method: str, path: str) -> None:
    client.request("PUT", f"{PRESETS}/evening")
    problem = check_problem(client.request(method, f"{PRESETS}/evenink{path}"), 404)
    assert "evening" in problem["cure"]


def test_a_preset_of_what_is_gone_changes_nothing(client: Client, camera: FakeCamera) -> None:
    client.put(f"{PRESETS}/gone", {"lighting": {"environment": "gone"}})
    before = camera.scene_controller.scene
    check_problem(client.post(f"{PRESETS}/gone/apply"), 404)
    assert camera.scene_controller.scene is before


@pytest.mark.parametrize("body", [{"lighting": {"blend": 2}}, {"light": {}}, {"mode": "disco"}])
def test_bad_looks_are_refused(client: Client, body: object) -> None:
    check_problem(client.put(f"{PRESETS}/bad", body), 422)
    assert client.get(PRESETS).json() == []


def test_a_folder_that_cannot_be_written_is_said_without_its_place(client: Client, tmp_path: Path) -> None:
    (tmp_path / "data").write_text("a file where the data folder should be")
    answer = client.request("PUT", f"{PRESETS}/evening")
    problem = check_problem(answer, 507)
    assert problem["cure"]
    assert str(tmp_path) not in answer.text


def test_files_are_yaml_that_people_can_read(tmp_path: Path) -> None:
    PresetStore(tmp_path).save("evening", LOOK)
    assert [path.name for path in tmp_path.iterdir()] == ["evening.yaml"]
    assert yaml.safe_load((tmp_path / "evening.yaml").read_text())["lighting"]["yaw_deg"] == -40


@pytest.mark.parametrize("text", ["mode: disco", "lighting: [", "- 1", "", "\x00"])
def test_damaged_files_are_named_and_do_not_hide_the_others(tmp_path: Path, text: str) -> None:
    store = PresetStore(tmp_path)
    store.save("good", LOOK)
    (tmp_path / "bad.yaml").write_text(text)
    assert store.names() == ["bad", "good"]
    with pytest.raises(InputError, match="'bad'"):
        store.load("bad")
    assert store.load("good") == LOOK


def test_a_store_without_a_folder_is_empty(tmp_path: Path) -> None:
    store = PresetStore(tmp_path / "none")
    assert store.names() == []
    with pytest.raises(NotFoundError, match="'x'"):
        store.remove("x")


@pytest.mark.slow
def test_a_preset_keeps_no_subject_that_is_not_stored(client: Client, camera: FakeCamera) -> None:
    camera.scene_controller.show_subject("guest", small_subject())
    assert client.request("PUT", f"{PRESETS}/mine").json()["subject"] is None
    assert client.post(f"{PRESETS}/mine/apply").status_code == 200
    assert camera.scene_controller.scene.subject_name == "guest"


def test_a_preset_shows_its_subject_again(client: Client, camera: FakeCamera) -> None:
    for name in ("ada", "bea"):
        write_subject(camera.scene_controller.subjects.new_path(name), small_subject())
    camera.scene_controller.choose_stored_subject("ada")
    assert client.request("PUT", f"{PRESETS}/mine").json()["subject"] == "ada"
    client.put(f"{PRESETS}/anybody", {"mode": "portrait"})
    camera.scene_controller.choose_stored_subject("bea")
    before = camera.scene_controller.scene.revision
    client.post(f"{PRESETS}/mine/apply")
    assert (camera.scene_controller.scene.subject_name, camera.scene_controller.scene.revision) == ("ada", before + 1)
    client.post(f"{PRESETS}/anybody/apply")
    assert camera.scene_controller.scene.subject_name == "ada"
    camera.scene_controller.choose_stored_subject("bea")
    camera.scene_controller.subjects.remove("ada")
    check_problem(client.post(f"{PRESETS}/mine/apply"), 404)
    assert camera.scene_controller.scene.subject_name == "bea"


def test_one_at_most_is_shown_at_the_start(client: Client) -> None:
    def at_start() -> list[str]:
        return [item["name"] for item in client.get(PRESETS).json() if item["at_start"]]

    for name in ("day", "night"):
        client.request("PUT", f"{PRESETS}/{name}")
    assert client.patch(f"{PRESETS}/day", {"at_start": True}).json() == {"name": "day", "at_start": True}
    client.patch(f"{PRESETS}/night", {"at_start": False})
    assert at_start() == ["day"]
    client.patch(f"{PRESETS}/night", {"at_start": True})
    assert at_start() == ["night"]
    client.patch(f"{PRESETS}/night", {"name": "late night"})
    assert at_start() == ["late night"]
    client.delete(f"{PRESETS}/late night")
    client.request("PUT", f"{PRESETS}/late night")
    assert at_start() == []


def test_a_preset_is_renamed(client: Client) -> None:
    client.put(f"{PRESETS}/day", {"mode": "portrait"})
    client.request("PUT", f"{PRESETS}/night")
    check_problem(client.patch(f"{PRESETS}/day", {"name": "night"}), 409)
    check_problem(client.patch(f"{PRESETS}/day", {"name": "../day"}), 422)
    check_problem(client.patch(f"{PRESETS}/noon", {"name": "evening"}), 404)
    assert client.patch(f"{PRESETS}/day", {"name": "day"}).status_code == 200
    client.patch(f"{PRESETS}/day", {"name": "noon"})
    assert [item["name"] for item in client.get(PRESETS).json()] == ["night", "noon"]
    assert client.get(f"{PRESETS}/noon").json()["mode"] == "portrait"


def test_names_are_checked_where_no_api_has_done_so(tmp_path: Path) -> None:
    store = PresetStore(tmp_path)
    store.save("day", LOOK)
    store.save("night", LOOK)
    with pytest.raises(ConflictError):
        store.rename("day", "night")
    with pytest.raises(InputError):
        store.rename("day", "../day")
    with pytest.raises(NotFoundError):
        store.set_at_start("noon")
    store.set_at_start("day")
    (tmp_path / "day.yaml").unlink()
    assert store.at_start() is None
    (tmp_path / "at-start").write_bytes(b"\xff\xfe" * 100)
    assert store.at_start() is None


def test_a_preset_of_before_reads_as_one_of_whoever_is_shown(tmp_path: Path) -> None:
    (tmp_path / "old.yaml").write_text("mode: reenact\n")
    assert PresetStore(tmp_path).load("old") == Preset(mode=Mode.PORTRAIT)
