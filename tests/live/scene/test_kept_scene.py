"""What a run begins with: settings, the last run's look, a preset at start, the command line; and what it keeps."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from relit_camera.base.config.look import ANYONE, ColorBackground, Lighting, Look, Mode, Preset
from relit_camera.base.config.preset_store import PresetStore
from relit_camera.base.config.settings import OutputSettings, RelitSettings, StorageSettings
from relit_camera.base.errors import NotReadyError, StorageError
from relit_camera.live.scene.kept_scene import (
    GivenOptions,
    KeptScene,
    SceneKeeper,
    kept_scene_path,
    read_kept_scene,
    show_first_scene,
)
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.subject.subject_file import write_subject
from tests.api.api_client import hdr
from tests.generated_subject import small_subject

NOTHING_GIVEN = GivenOptions()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A data folder with the subjects ada and bea."""
    for name in ("ada", "bea"):
        write_subject(SceneController(StorageSettings(data_dir=tmp_path)).subjects.new_path(name), small_subject())
    return tmp_path


def settings(folder: Path, **values: object) -> RelitSettings:
    return RelitSettings.model_validate({"storage": {"data_dir": folder}, **values})


def run(
    wanted: RelitSettings,
    change: Callable[[SceneController], object] = lambda controller: None,
    given: GivenOptions | None = NOTHING_GIVEN,
    **options: object,
) -> Scene:
    """One run in which something is changed. Returns the scene that it began with."""
    controller = SceneController(wanted.storage)
    show_first_scene(controller, wanted, given=given, **options)  # type: ignore[arg-type]
    first = controller.scene
    if given is not None:
        keeper = SceneKeeper(controller, wanted, given)
        change(controller)
        keeper.check()
    return first


def sunset_portrait(controller: SceneController) -> None:
    look = Look(lighting=Lighting(environment="sunset", yaw_deg=30), background=ColorBackground(), mode=Mode.PORTRAIT)
    controller.set_look(look)
    controller.choose_stored_subject("ada")


def test_look_and_subject_are_those_of_the_last_run(folder: Path) -> None:
    first = run(settings(folder), sunset_portrait)
    assert (first.subject_name, first.look) == (ANYONE, Look())
    again = run(settings(folder))
    assert (again.subject_name, again.look.lighting.environment, again.look.mode) == ("ada", "sunset", Mode.PORTRAIT)
    assert again.environment is not None
    assert again.environment.name == "sunset"
    assert (again.can_undo, again.can_redo) == (False, False)
    assert run(settings(folder), lambda controller: controller.choose_stored_subject(None)).subject_name == "ada"
    assert run(settings(folder)).subject_name is None


def test_reset_shows_what_the_settings_say(folder: Path) -> None:
    run(settings(folder), sunset_portrait)
    controller = SceneController(StorageSettings(data_dir=folder))
    show_first_scene(controller, settings(folder, subject="bea"), given=NOTHING_GIVEN)
    assert controller.reset().look == Look()
    assert controller.scene.subject_name == "bea"


def test_nothing_is_kept_where_that_is_not_asked_for(folder: Path) -> None:
    run(settings(folder), sunset_portrait)
    assert run(settings(folder), given=None).look == Look()


def test_what_was_edited_in_the_configuration_since_wins(folder: Path) -> None:
    before = settings(folder, subject="bea", look={"lighting": {"saturation": 0.5}})
    run(before, sunset_portrait)
    edited = settings(folder, subject="bea", look={"lighting": {"saturation": 0.5, "yaw_deg": -10}})
    again = run(edited)
    assert (again.look.lighting.yaw_deg, again.look.lighting.environment, again.subject_name) == (-10, "sunset", "ada")
    other = settings(folder, look={"lighting": {"saturation": 0.5, "yaw_deg": -10}})
    assert run(other).subject_name == ANYONE


def test_a_preset_at_start_wins_over_the_last_run(folder: Path) -> None:
    run(settings(folder), sunset_portrait)
    presets = PresetStore(settings(folder).storage.presets)
    presets.save("calm", Preset(lighting=Lighting(environment="overcast")))
    presets.save("bea", Preset(subject="bea"))
    presets.set_at_start("calm")
    first = run(settings(folder))
    assert (first.look.lighting.environment, first.subject_name) == ("overcast", "ada")
    presets.set_at_start("bea")
    assert run(settings(folder)).subject_name == "bea"


def test_the_command_line_wins_over_both(folder: Path) -> None:
    run(settings(folder), sunset_portrait)
    PresetStore(settings(folder).storage.presets).save("bea", Preset(subject="bea", mode=Mode.LIVE))
    PresetStore(settings(folder).storage.presets).set_at_start("bea")
    wanted = settings(folder, subject="ada", look={"mode": "portrait"})
    first = run(wanted, given=GivenOptions(subject=True, mode=True), environment="party")
    assert (first.subject_name, first.look.mode, first.look.lighting.environment) == ("ada", Mode.PORTRAIT, "party")
    assert run(settings(folder), instant=True).subject_name is None


def test_what_the_command_line_said_is_kept_as_what_was_shown(folder: Path) -> None:
    wanted = settings(folder, subject="ada", look={"mode": "portrait"})
    run(wanted, lambda controller: controller.set_frozen(True), GivenOptions(subject=True, mode=True))
    run(wanted, lambda controller: controller.set_look(Look(mode=Mode.PORTRAIT, lighting=Lighting(yaw_deg=9))),
        GivenOptions(subject=True, mode=True))  # fmt: skip
    again = run(settings(folder))
    assert (again.subject_name, again.look.mode, again.look.lighting.yaw_deg) == ("ada", Mode.PORTRAIT, 9)


def test_a_scene_of_before_is_shown_though_the_default_was_another(folder: Path) -> None:
    old = "{look: {mode: reenact, lighting: {yaw_deg: 9}}, configured_look: {mode: reenact}}"
    kept_scene_path(StorageSettings(data_dir=folder)).write_text(old)
    again = run(settings(folder), lambda controller: controller.choose_stored_subject("ada"))
    assert (again.look.mode, again.look.lighting.yaw_deg) == (Mode.PORTRAIT, 9)
    assert "mode: portrait" in kept_scene_path(StorageSettings(data_dir=folder)).read_text()


def test_a_subject_that_is_not_stored_is_left_to_the_settings(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "elsewhere" / "me.relit"
    file.parent.mkdir()
    write_subject(file, small_subject())
    run(settings(folder, subject=str(file)), lambda controller: controller.set_look(Look(mode=Mode.PORTRAIT)))
    again = run(settings(folder, subject=str(file)))
    assert (again.subject_name, again.look.mode) == ("me", Mode.PORTRAIT)
    assert run(settings(folder)).subject_name == ANYONE


def test_what_is_gone_is_left_out_and_said(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    def change(controller: SceneController) -> None:
        sunset_portrait(controller)
        controller.environments.add_upload("room", io.BytesIO(hdr()), ".hdr")
        controller.update_look(
            lambda look: look.model_copy(update={"lighting": look.lighting.model_copy(update={"environment": "room"})})
        )

    run(settings(folder), change)
    controller = SceneController(StorageSettings(data_dir=folder))
    controller.environments.remove("room")
    controller.subjects.remove("ada")
    first = run(settings(folder))
    assert (first.subject_name, first.look.lighting.environment, first.look.lighting.yaw_deg) == (None, "studio", 30)
    assert "room" in caplog.text
    assert "ada" in caplog.text


@pytest.mark.parametrize("text", ["", "look: [", "look: {mode: disco}", "\x00", "[" * 100_000, "#" * (2 << 20)])
def test_a_damaged_file_is_said_and_left_out(folder: Path, text: str, caplog: pytest.LogCaptureFixture) -> None:
    kept_scene_path(StorageSettings(data_dir=folder)).write_text(text)
    assert run(settings(folder), sunset_portrait).look == Look()
    assert "last-scene.yaml" in caplog.text
    assert run(settings(folder)).subject_name == "ada"


# Whoever comes, and nobody


def hide(controller: SceneController) -> None:
    controller.choose_stored_subject(None)


def test_whoever_comes_is_relit_until_somebody_chooses(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "relit_camera")
    first = run(settings(folder), lambda controller: controller.set_look(Look(lighting=Lighting(yaw_deg=9))))
    assert (first.subject_name, first.shows_nobody) == (ANYONE, False)
    assert "to hide them" in caplog.text
    again = run(settings(folder))
    assert (again.subject_name, again.look.lighting.yaw_deg) == (ANYONE, 9)


def test_whoever_hid_is_hidden_after_a_restart(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "relit_camera")
    run(settings(folder), hide)
    caplog.clear()
    assert run(settings(folder)).shows_nobody
    assert "to hide them" not in caplog.text
    assert run(settings(folder), instant=True).shows_nobody
    assert run(settings(folder, subject="bea")).subject_name == "bea"  # somebody has written that since
    assert run(settings(folder, subject="bea"), hide).subject_name == "bea"
    assert run(settings(folder)).shows_nobody  # and taken it away again


def test_an_explicit_choice_of_the_settings_is_kept_to(folder: Path) -> None:
    assert run(settings(folder, subject=None)).shows_nobody
    run(settings(folder), lambda controller: controller.set_look(Look(mode=Mode.PORTRAIT)))
    assert run(settings(folder, subject=None)).subject_name is None
    run(settings(folder, subject=None), hide)
    assert run(settings(folder, subject=ANYONE)).subject_name == ANYONE


@pytest.mark.parametrize("kept", ["{look: {}, subject: null}", "{look: {}, subject: null, configured_subject: null}"])
def test_nobody_of_a_version_before_stays_nobody(folder: Path, kept: str) -> None:
    """It wrote the same where nobody was ever chosen: whoever was not seen then is not seen now."""
    kept_scene_path(StorageSettings(data_dir=folder)).write_text(kept)
    assert run(settings(folder)).shows_nobody


def test_a_face_that_is_gone_is_not_replaced_by_the_live_picture(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    run(settings(folder), lambda controller: controller.choose_stored_subject("ada"))
    SceneController(StorageSettings(data_dir=folder)).subjects.remove("ada")
    assert run(settings(folder)).shows_nobody
    assert "ada" in caplog.text
    assert run(settings(folder, subject="bea")).subject_name == "bea"


def test_a_damaged_file_shows_nobody_since_that_may_have_been_chosen(folder: Path) -> None:
    kept_scene_path(StorageSettings(data_dir=folder)).write_text("look: [")
    assert run(settings(folder)).shows_nobody


def test_reset_shows_whoever_is_shown(folder: Path) -> None:
    controller = SceneController(StorageSettings(data_dir=folder))
    show_first_scene(controller, settings(folder), given=NOTHING_GIVEN)
    for name in (None, "ada"):
        controller.choose_stored_subject(name)
        assert controller.reset().subject_name == name


# Nothing as filmed unasked


def test_permission_for_the_picture_as_filmed_is_not_kept(folder: Path) -> None:
    def change(controller: SceneController) -> None:
        controller.change(
            lambda look: look.model_copy(
                update={"mode": Mode.LIVE, "lighting": look.lighting.model_copy(update={"split": 0.5})}
            ),
            unlit_allowed=True,
        )

    run(settings(folder), change)
    again = run(settings(folder))
    assert (again.unlit_allowed, again.look.lighting.split, again.look.mode) == (False, 0, Mode.LIVE)


def test_settings_that_show_it_count_where_they_allow_it_too(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    look = {"mode": "live", "lighting": {"split": 0.5}}
    assert run(settings(folder, look=look)).look.lighting.split == 0
    assert "output.unlit_allowed" in caplog.text
    allowed = settings(folder, look=look, output=OutputSettings(unlit_allowed=True))
    first = run(allowed, given=None)
    assert (first.look.lighting.split, first.unlit_allowed) == (0.5, True)
    assert not run(allowed, given=None, instant=True).unlit_allowed


def test_that_others_may_move_the_portrait_is_not_kept_and_counts_for_whoever_is_shown_first(folder: Path) -> None:
    def change(controller: SceneController) -> None:
        controller.choose_stored_subject("bea")
        controller.set_avatar_allowed(True)

    run(settings(folder), change)
    again = run(settings(folder))
    assert (again.subject_name, again.avatar_allowed) == ("bea", False)
    first = run(settings(folder, output=OutputSettings(avatar_allowed=True)))
    assert (first.subject_name, first.avatar_allowed) == ("bea", True)
    allowed = settings(folder, subject="ada", output=OutputSettings(avatar_allowed=True))
    for given in (NOTHING_GIVEN, GivenOptions(subject=True), None):
        assert run(allowed, given=given).avatar_allowed
    assert not run(allowed, given=None, instant=True).avatar_allowed


# Writing


def test_an_unchanged_scene_is_not_written_again(folder: Path) -> None:
    controller = SceneController(StorageSettings(data_dir=folder))
    show_first_scene(controller, settings(folder))
    keeper = SceneKeeper(controller, settings(folder), NOTHING_GIVEN)
    path = kept_scene_path(StorageSettings(data_dir=folder))
    keeper.check()
    assert not path.exists()
    controller.set_look(Look(mode=Mode.PORTRAIT))
    keeper.check()
    written = path.stat().st_mtime_ns
    controller.set_frozen(True)
    keeper.check()
    assert path.stat().st_mtime_ns == written


def test_an_unchanged_scene_costs_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    controller = SceneController(StorageSettings(data_dir=folder))
    show_first_scene(controller, settings(folder))
    keeper, dumped = SceneKeeper(controller, settings(folder), NOTHING_GIVEN), []
    whole = KeptScene.model_dump

    def dump(kept: KeptScene, **options: Any) -> dict[str, object]:
        dumped.append(kept)
        return whole(kept, **options)

    monkeypatch.setattr(KeptScene, "model_dump", dump)
    for _ in range(5):
        keeper.check()
    assert dumped == []
    controller.set_look(Look(mode=Mode.PORTRAIT))
    for _ in range(5):
        keeper.check()
    assert len(dumped) == 1


def test_the_longest_name_that_a_subject_s_file_can_have_is_kept(folder: Path) -> None:
    name = "a" * 200
    subjects = SceneController(StorageSettings(data_dir=folder)).subjects.folder
    (subjects / "ada.relit").rename(subjects / f"{name}.relit")
    assert run(settings(folder, subject=name)).subject_name == name
    run(settings(folder), lambda controller: controller.choose_stored_subject(name))
    assert run(settings(folder)).subject_name == name


def test_a_folder_that_cannot_be_read_ends_nothing_and_is_said_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> list[str]:
        raise StorageError("cannot read the subjects: Permission denied", "check its permissions")

    controller = SceneController(StorageSettings(data_dir=folder))
    show_first_scene(controller, settings(folder, subject="ada"))
    with monkeypatch.context() as broken:
        broken.setattr(controller.subjects, "names", fail)
        keeper = SceneKeeper(controller, settings(folder), NOTHING_GIVEN)
        keeper.check()
        keeper.check()
    assert caplog.text.count("Permission denied") == 1
    controller.set_look(Look(mode=Mode.PORTRAIT))
    keeper.check()
    kept = read_kept_scene(kept_scene_path(StorageSettings(data_dir=folder)))
    assert kept is not None
    assert (kept.look.mode, kept.subject) == (Mode.PORTRAIT, "ada")


def test_a_disk_that_takes_nothing_is_said_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(path: Path, text: str) -> None:
        raise StorageError("the disk is full", "make room")

    controller = SceneController(StorageSettings(data_dir=folder))
    show_first_scene(controller, settings(folder))
    keeper = SceneKeeper(controller, settings(folder), NOTHING_GIVEN)
    controller.set_look(Look(mode=Mode.PORTRAIT))
    with monkeypatch.context() as broken:
        broken.setattr("relit_camera.live.scene.kept_scene.write_atomic", fail)
        keeper.check()
        keeper.check()
    assert caplog.text.count("the disk is full") == 1
    keeper.check()
    assert kept_scene_path(StorageSettings(data_dir=folder)).exists()


def test_a_place_that_cannot_be_decoded_now_does_not_end_the_program(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(name: str) -> object:
        raise NotReadyError("too little free memory to decode a file", "close other programs and try again")

    controller = SceneController(StorageSettings(data_dir=folder))
    monkeypatch.setattr(controller.environments, "load", fail)
    monkeypatch.setattr(controller.environments, "resolve", fail)
    show_first_scene(controller, settings(folder), environment="/somewhere/sunset.hdr")
    assert controller.scene.environment is None
    assert controller.scene.look.lighting.environment is None
    assert "sunset.hdr" in caplog.text
    assert "too little free memory" in caplog.text
    assert "/somewhere" not in caplog.text
