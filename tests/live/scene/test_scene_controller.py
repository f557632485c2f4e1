"""What users ask for becomes a scene whole, or not at all."""

from __future__ import annotations

import io
import shutil
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.config.look import (
    BlurBackground,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Lighting,
    Look,
    Mode,
)
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import InputError, NotFoundError, SubjectError
from relit_camera.base.images.image_files import encode_display, write_linear
from relit_camera.light.light_map import irradiance
from relit_camera.live.scene.look_loader import BACKGROUND_ENVIRONMENT
from relit_camera.live.scene.scene_controller import ChosenSubject, SceneController
from relit_camera.subject.subject_file import write_subject
from tests.generated_subject import small_subject


@pytest.fixture
def scene_controller(tmp_path: Path) -> SceneController:
    return SceneController(StorageSettings(data_dir=tmp_path))


def half_bright(right: bool) -> bytes:
    """A picture whose one half is bright, as a PNG file."""
    picture = np.full((60, 80, 3), 20, np.uint8)
    picture[:, 40:] = 240 if right else 20
    picture[:, :40] = 20 if right else 240
    return encode_display(picture, ".png")


def lit_from_right(scene_controller: SceneController) -> float:
    """How much more light comes from the picture's right than from its left."""
    environment = scene_controller.scene.environment
    assert environment is not None
    columns = environment.light_map.sum(axis=(0, 2))
    return float(columns[32:].sum() - columns[:32].sum())


def test_first_look_is_not_resolved_until_it_is_set(scene_controller: SceneController) -> None:
    assert scene_controller.scene.environment is None
    scene = scene_controller.set_look(Look())
    assert scene is scene_controller.scene
    assert scene.environment is not None
    assert scene.environment.name == "studio"
    assert scene.revision == 1


def test_lamps_only(scene_controller: SceneController) -> None:
    assert scene_controller.set_look(Look(lighting=Lighting(environment=None))).environment is None


@pytest.mark.parametrize(
    ("look", "words"),
    [
        (Look(lighting=Lighting(environment="stduio")), "studio"),
        (Look(background=ImageBackground(image="beach")), "beach"),
        (Look(lighting=Lighting(environment=BACKGROUND_ENVIRONMENT)), "choose an image or color background"),
        (Look(lighting=Lighting(environment=BACKGROUND_ENVIRONMENT), background=BlurBackground()), "kind 'blur'"),
        (
            Look(lighting=Lighting(environment=BACKGROUND_ENVIRONMENT), background=EnvironmentBackground()),
            "needs a name",
        ),
    ],
)
def test_what_cannot_be_resolved_leaves_the_scene(look: Look, words: str, scene_controller: SceneController) -> None:
    before = scene_controller.set_look(Look())
    with pytest.raises(InputError) as error:
        scene_controller.set_look(look)
    assert words in str(error.value)
    assert scene_controller.scene is before


def test_a_file_is_admitted_for_this_run_and_only_by_the_command_line(
    scene_controller: SceneController, tmp_path: Path
) -> None:
    path = tmp_path / "my sky (1).exr"
    write_linear(path, np.ones((16, 32, 3), np.float32))
    name = scene_controller.register_temporary_environment(str(path))
    assert name == "my-sky-1"
    assert scene_controller.set_look(Look(lighting=Lighting(environment=name))).environment is not None
    assert name not in scene_controller.environments.names()
    assert scene_controller.register_temporary_environment("sunset") == "sunset"
    assert scene_controller.register_temporary_environment(BACKGROUND_ENVIRONMENT) == BACKGROUND_ENVIRONMENT
    with pytest.raises(NotFoundError):
        scene_controller.register_temporary_environment("nothing-like-it")


def test_a_colour_lights_the_face_in_its_colour(scene_controller: SceneController) -> None:
    look = Look(lighting=Lighting(environment=BACKGROUND_ENVIRONMENT), background=ColorBackground(color="#ff2000"))
    environment = scene_controller.set_look(look).environment
    assert environment is not None
    red, green, blue = environment.light_map.reshape(-1, 3).mean(axis=0)
    assert red > 5 * green >= 5 * blue


@pytest.mark.parametrize("right", [True, False])
def test_a_picture_lights_the_face_from_its_bright_side(right: bool, scene_controller: SceneController) -> None:
    scene_controller.backgrounds.add("room", io.BytesIO(half_bright(right)))
    look = Look(lighting=Lighting(environment=BACKGROUND_ENVIRONMENT), background=ImageBackground(image="room"))
    scene = scene_controller.set_look(look)
    assert scene.background_image is not None
    assert (lit_from_right(scene_controller) > 0) == right


def test_another_background_lights_anew(scene_controller: SceneController) -> None:
    for name, right in (("a", True), ("b", False)):
        scene_controller.backgrounds.add(name, io.BytesIO(half_bright(right)))
    lighting = Lighting(environment=BACKGROUND_ENVIRONMENT)
    scene_controller.set_look(Look(lighting=lighting, background=ImageBackground(image="a")))
    assert lit_from_right(scene_controller) > 0
    scene_controller.set_look(Look(lighting=lighting, background=ImageBackground(image="b")))
    assert lit_from_right(scene_controller) < 0


def test_an_environment_as_background_picture_is_seen_from_inside(scene_controller: SceneController) -> None:
    scene = scene_controller.set_look(Look(background=ImageBackground(image="window")))
    assert scene.background_image is not None
    assert scene.background_image.dtype == np.uint8
    halves = np.split(scene.background_image.astype(np.float64), 2, axis=1)
    brighter_right = float(halves[1].mean() - halves[0].mean())
    lit = Look(lighting=Lighting(environment=BACKGROUND_ENVIRONMENT), background=ImageBackground(image="window"))
    environment = scene_controller.set_look(lit).environment
    assert environment is not None
    np.testing.assert_array_equal(environment.light_map, scene_controller.environments.load("window").light_map)
    sides = [irradiance(environment.light_map, [x, 0, 0]).mean() for x in (-1.0, 1.0)]
    assert np.sign(brighter_right) == np.sign(sides[1] - sides[0])
    assert abs(brighter_right) > 5


def test_what_a_change_leaves_alone_is_kept(scene_controller: SceneController, monkeypatch: pytest.MonkeyPatch) -> None:
    scene_controller.backgrounds.add("room", io.BytesIO(half_bright(True)))
    before = scene_controller.set_look(Look(background=ImageBackground(image="room")))
    monkeypatch.setattr(scene_controller.backgrounds, "load", pytest.fail)
    monkeypatch.setattr(scene_controller.environments, "load", pytest.fail)
    change: Callable[[Look], Look] = lambda look: look.model_copy(  # noqa: E731
        update={"lighting": look.lighting.model_copy(update={"exposure_ev": 1.0}), "mode": Mode.LIVE}
    )
    after = scene_controller.update_look(change)
    assert after.background_image is before.background_image
    assert after.environment is before.environment
    assert after.look.mode is Mode.LIVE


@pytest.mark.parametrize("stem", [BACKGROUND_ENVIRONMENT, "studio", "background!", "s" * 80])
def test_a_file_takes_no_name_that_means_something_else(
    stem: str, scene_controller: SceneController, tmp_path: Path
) -> None:
    path = tmp_path / f"{stem}.exr"
    write_linear(path, np.full((32, 64, 3), 0.5, np.float32))
    name = scene_controller.register_temporary_environment(str(path))
    assert name not in {BACKGROUND_ENVIRONMENT, *scene_controller.environments.names()}
    environment = scene_controller.set_look(Look(lighting=Lighting(environment=name))).environment
    assert environment is scene_controller.temporary_environments()[name]


@pytest.fixture
def subject_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A subject file in the working folder, which is no store."""
    monkeypatch.chdir(tmp_path)
    write_subject(tmp_path / "me.relit", small_subject())
    return tmp_path / "me.relit"


@pytest.fixture
def stored_subject(subject_file: Path, scene_controller: SceneController) -> Path:
    """The same subject in the store, called `stored`."""
    scene_controller.subjects.folder.mkdir(parents=True)
    return Path(shutil.copy(subject_file, scene_controller.subjects.folder / "stored.relit"))


@pytest.mark.usefixtures("stored_subject")
def test_the_api_chooses_stored_subjects_only(scene_controller: SceneController, subject_file: Path) -> None:
    assert scene_controller.choose_stored_subject("stored").subject_name == "stored"
    kept = scene_controller.scene
    for name in ("nobody", "me", "me.relit", "./me.relit", str(subject_file)):
        with pytest.raises(NotFoundError):
            scene_controller.choose_stored_subject(name)
    assert scene_controller.scene is kept
    assert scene_controller.choose_stored_subject(None).subject is None


def test_a_subject_file_is_shown_under_its_name(scene_controller: SceneController, subject_file: Path) -> None:
    assert scene_controller.load_configured_subject(str(subject_file)).subject_name == "me"
    kept = scene_controller.scene
    with pytest.raises(NotFoundError, match=r"none\.relit"):
        scene_controller.load_configured_subject(str(subject_file.with_name("none.relit")))
    subject_file.write_bytes(b"damaged")
    with pytest.raises(SubjectError):
        scene_controller.load_configured_subject(str(subject_file))
    assert scene_controller.scene is kept


@pytest.mark.usefixtures("stored_subject")
def test_the_configuration_names_a_stored_subject_or_a_file(
    scene_controller: SceneController, subject_file: Path
) -> None:
    assert scene_controller.load_configured_subject("stored").subject_name == "stored"
    assert scene_controller.load_configured_subject(str(subject_file)).subject_name == "me"
    with pytest.raises(NotFoundError, match="no subject 'nobody'; there are: stored"):
        scene_controller.load_configured_subject("nobody")
    assert scene_controller.load_configured_subject(None).subject is None


@pytest.mark.usefixtures("stored_subject")
def test_a_subject_that_is_renamed_is_found_by_undo_redo_and_reset(scene_controller: SceneController) -> None:
    scene_controller.choose_stored_subject("stored")
    scene_controller.mark_start()
    scene_controller.choose_stored_subject(None)
    scene_controller.rename_stored_subject("stored", "lovelace")
    assert scene_controller.undo().subject_name == "lovelace"
    scene_controller.rename_stored_subject("lovelace", "stored")
    assert scene_controller.redo().subject_name is None
    assert scene_controller.reset().subject_name == "stored"
    assert scene_controller.scene.subject is not None
    scene_controller.rename_stored_subject("stored", "countess")
    assert scene_controller.undo().subject_name is None
    assert scene_controller.redo().subject_name == "countess"


@pytest.mark.usefixtures("stored_subject")
def test_a_step_that_cannot_be_restored_is_not_offered_again(scene_controller: SceneController) -> None:
    scene_controller.choose_stored_subject("stored")
    scene_controller.mark_start()
    scene_controller.choose_stored_subject(None)
    scene_controller.subjects.remove("stored")
    with pytest.raises(NotFoundError, match="no subject 'stored'"):
        scene_controller.undo()
    assert (scene_controller.scene.can_undo, scene_controller.scene.can_redo) == (False, False)


@pytest.mark.usefixtures("stored_subject")
def test_a_step_that_cannot_be_done_again_is_not_offered_again(scene_controller: SceneController) -> None:
    scene_controller.choose_stored_subject("stored")
    assert scene_controller.undo().can_redo
    before = scene_controller.scene
    scene_controller.subjects.remove("stored")
    with pytest.raises(NotFoundError, match="no subject 'stored'"):
        scene_controller.redo()
    assert (scene_controller.scene.can_undo, scene_controller.scene.can_redo) == (False, False)
    assert scene_controller.scene.revision > before.revision  # so that whoever listens hears of it


def test_changes_from_many_threads_are_all_made(scene_controller: SceneController) -> None:
    scene_controller.set_look(Look(lighting=Lighting(exposure_ev=0)))

    def brighten() -> None:
        for _ in range(50):
            scene_controller.update_look(
                lambda look: look.model_copy(
                    update={
                        "lighting": look.lighting.model_copy(update={"exposure_ev": look.lighting.exposure_ev + 0.01})
                    }
                )
            )

    threads = [threading.Thread(target=brighten) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert scene_controller.scene.look.lighting.exposure_ev == pytest.approx(2.0)
    assert scene_controller.scene.revision == 201


def test_background_names(scene_controller: SceneController) -> None:
    scene_controller.backgrounds.add(
        "beach", io.BytesIO(cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    )
    assert {"beach", "studio"} <= set(scene_controller.background_names())


def test_what_needs_no_file_does_not_wait_for_one_that_is_read(
    scene_controller: SceneController, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene_controller.set_look(Look())
    scene_controller.set_unlit_allowed(True)
    begun, go_on = threading.Event(), threading.Event()
    load = scene_controller.environments.load

    def slow(name: str) -> object:
        begun.set()
        assert go_on.wait(20)
        return load(name)

    monkeypatch.setattr(scene_controller.environments, "load", slow)
    lit = Lighting(environment="window", yaw_deg=3)
    chosen = threading.Thread(
        target=scene_controller.update_look,
        args=(lambda look: look.model_copy(update={"lighting": lit.model_copy(update={"exposure_ev": 1.0})}),),
    )
    chosen.start()
    assert begun.wait(20)
    others = [
        lambda: scene_controller.set_unlit_allowed(False),
        lambda: scene_controller.set_frozen(True),
        scene_controller.undo,
    ]
    for other in others:
        changing = threading.Thread(target=other, daemon=True)
        changing.start()
        changing.join(5)
        waits = changing.is_alive()
        if waits:
            go_on.set()
        assert not waits
    assert not scene_controller.scene.unlit_allowed
    go_on.set()
    chosen.join(20)
    scene = scene_controller.scene
    assert scene.environment is not None
    assert (scene.environment.name, scene.look.lighting.environment) == ("window", "window")
    assert (scene.frozen, scene.unlit_allowed) == (True, False)


@pytest.fixture
def avatar(scene_controller: SceneController) -> SceneController:
    """Shows ada, whose portrait others may move; bea is another person, `ada again` another file of the same."""
    ada = small_subject()
    bea = replace(ada, metadata=ada.metadata.model_copy(update={"created_at": "2027-01-01"}))
    for name, subject in {"ada": ada, "ada again": ada, "bea": bea}.items():
        write_subject(scene_controller.subjects.new_path(name), subject)
    scene_controller.choose_stored_subject("ada")
    scene_controller.set_avatar_allowed(True)
    return scene_controller


@pytest.mark.parametrize(("name", "stays"), [("ada", True), ("ada again", True), ("bea", False), (None, False)])
def test_others_may_move_the_portrait_of_one_person(avatar: SceneController, name: str | None, stays: bool) -> None:
    assert avatar.update_look(lambda look: look.model_copy(update={"mode": Mode.PORTRAIT})).avatar_allowed
    assert avatar.choose_stored_subject(name).avatar_allowed is stays
    assert avatar.choose_stored_subject("ada").avatar_allowed is stays
    assert avatar.change(subject=ChosenSubject("bea"), avatar_allowed=True).avatar_allowed


def test_the_portrait_of_a_renamed_person_may_still_be_moved(avatar: SceneController) -> None:
    assert avatar.rename_stored_subject("ada", "lovelace").avatar_allowed


def test_no_step_back_or_forward_lets_others_move_a_portrait(avatar: SceneController) -> None:
    avatar.set_look(Look(lighting=Lighting(yaw_deg=5)))
    avatar.set_avatar_allowed(False)
    steps = (avatar.undo, avatar.undo, avatar.redo, avatar.redo, avatar.reset)
    assert [step().avatar_allowed for step in steps] == [False] * 5
    avatar.set_look(Look(lighting=Lighting(yaw_deg=10)))
    avatar.set_avatar_allowed(True)
    assert not avatar.undo().avatar_allowed, "a step back takes the permission back"


def test_a_step_back_to_another_person_takes_the_permission_with_it(avatar: SceneController) -> None:
    avatar.change(subject=ChosenSubject("bea"), avatar_allowed=True)
    back = avatar.undo()
    assert (back.subject_name, back.avatar_allowed) == ("ada", False)


def test_a_file_that_fails_to_be_read_is_dropped_from_the_steps_once(
    scene_controller: SceneController, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene_controller.set_look(Look())
    scene_controller.set_look(Look(lighting=Lighting(environment="window")))
    reads = []

    def fail(name: str) -> object:
        reads.append(name)
        raise NotFoundError("it is deleted")

    monkeypatch.setattr(scene_controller.environments, "load", fail)
    with pytest.raises(NotFoundError, match="deleted"):
        scene_controller.undo()
    assert reads == ["studio"]
    assert not scene_controller.scene.can_undo
