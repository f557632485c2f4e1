"""What users ask for becomes a scene whole, or not at all."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.config.look import (
    BlurBackground,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Lighting,
    Look,
    Mode,
)
from relit_camera.config.settings import StorageSettings
from relit_camera.errors import InputError, NotFoundError, SubjectError
from relit_camera.light.maps import irradiance
from relit_camera.space.picture_files import encode_display, write_linear
from relit_camera.stream.director import LIT_BY_BACKGROUND, Director
from relit_camera.subject.file import write_subject
from tests.stream.small_camera import small_subject


@pytest.fixture
def director(tmp_path: Path) -> Director:
    return Director(StorageSettings(data_dir=tmp_path))


def half_bright(right: bool) -> bytes:
    """A picture whose one half is bright, as a PNG file."""
    picture = np.full((60, 80, 3), 20, np.uint8)
    picture[:, 40:] = 240 if right else 20
    picture[:, :40] = 20 if right else 240
    return encode_display(picture, ".png")


def lit_from_right(director: Director) -> float:
    """How much more light comes from the picture's right than from its left."""
    environment = director.scene.environment
    assert environment is not None
    columns = environment.light_map.sum(axis=(0, 2))
    return float(columns[32:].sum() - columns[:32].sum())


def test_first_look_is_not_resolved_until_it_is_set(director: Director) -> None:
    assert director.scene.environment is None
    scene = director.set_look(Look())
    assert scene is director.scene
    assert scene.environment is not None
    assert scene.environment.name == "studio"
    assert scene.revision == 1


def test_lamps_only(director: Director) -> None:
    assert director.set_look(Look(lighting=Lighting(environment=None))).environment is None


@pytest.mark.parametrize(
    ("look", "words"),
    [
        (Look(lighting=Lighting(environment="stduio")), "studio"),
        (Look(background=ImageBackground(image="beach")), "beach"),
        (Look(lighting=Lighting(environment=LIT_BY_BACKGROUND)), "choose an image or color background"),
        (Look(lighting=Lighting(environment=LIT_BY_BACKGROUND), background=BlurBackground()), "kind 'blur'"),
        (Look(lighting=Lighting(environment=LIT_BY_BACKGROUND), background=EnvironmentBackground()), "needs a name"),
    ],
)
def test_what_cannot_be_resolved_leaves_the_scene(look: Look, words: str, director: Director) -> None:
    before = director.set_look(Look())
    with pytest.raises(InputError) as error:
        director.set_look(look)
    assert words in str(error.value)
    assert director.scene is before


def test_a_file_is_admitted_for_this_run_and_only_by_the_command_line(director: Director, tmp_path: Path) -> None:
    path = tmp_path / "my sky (1).exr"
    write_linear(path, np.ones((16, 32, 3), np.float32))
    name = director.admit_environment(str(path))
    assert name == "my-sky-1"
    assert director.set_look(Look(lighting=Lighting(environment=name))).environment is not None
    assert name not in director.environments.names()
    assert director.admit_environment("sunset") == "sunset"
    assert director.admit_environment(LIT_BY_BACKGROUND) == LIT_BY_BACKGROUND
    with pytest.raises(NotFoundError):
        director.admit_environment("nothing-like-it")


def test_a_colour_lights_the_face_in_its_colour(director: Director) -> None:
    look = Look(lighting=Lighting(environment=LIT_BY_BACKGROUND), background=ColorBackground(color="#ff2000"))
    environment = director.set_look(look).environment
    assert environment is not None
    red, green, blue = environment.light_map.reshape(-1, 3).mean(axis=0)
    assert red > 5 * green >= 5 * blue


@pytest.mark.parametrize("right", [True, False])
def test_a_picture_lights_the_face_from_its_bright_side(right: bool, director: Director) -> None:
    director.backgrounds.add("room", half_bright(right))
    look = Look(lighting=Lighting(environment=LIT_BY_BACKGROUND), background=ImageBackground(image="room"))
    scene = director.set_look(look)
    assert scene.backdrop is not None
    assert (lit_from_right(director) > 0) == right


def test_another_background_lights_anew(director: Director) -> None:
    for name, right in (("a", True), ("b", False)):
        director.backgrounds.add(name, half_bright(right))
    lighting = Lighting(environment=LIT_BY_BACKGROUND)
    director.set_look(Look(lighting=lighting, background=ImageBackground(image="a")))
    assert lit_from_right(director) > 0
    director.set_look(Look(lighting=lighting, background=ImageBackground(image="b")))
    assert lit_from_right(director) < 0


def test_an_environment_as_background_picture_is_seen_from_inside(director: Director) -> None:
    scene = director.set_look(Look(background=ImageBackground(image="window")))
    assert scene.backdrop is not None
    assert scene.backdrop.dtype == np.uint8
    halves = np.split(scene.backdrop.astype(np.float64), 2, axis=1)
    brighter_right = float(halves[1].mean() - halves[0].mean())
    lit = Look(lighting=Lighting(environment=LIT_BY_BACKGROUND), background=ImageBackground(image="window"))
    environment = director.set_look(lit).environment
    assert environment is not None
    np.testing.assert_array_equal(environment.light_map, director.environments.load("window").light_map)
    sides = [irradiance(environment.light_map, [x, 0, 0]).mean() for x in (-1.0, 1.0)]
    assert np.sign(brighter_right) == np.sign(sides[1] - sides[0])
    assert abs(brighter_right) > 5


def test_what_a_change_leaves_alone_is_kept(director: Director, monkeypatch: pytest.MonkeyPatch) -> None:
    director.backgrounds.add("room", half_bright(True))
    before = director.set_look(Look(background=ImageBackground(image="room")))
    monkeypatch.setattr(director.backgrounds, "load", pytest.fail)
    monkeypatch.setattr(director.environments, "load", pytest.fail)
    change: Callable[[Look], Look] = lambda look: look.model_copy(  # noqa: E731
        update={"lighting": look.lighting.model_copy(update={"exposure_ev": 1.0}), "mode": Mode.RATIO}
    )
    after = director.update_look(change)
    assert after.backdrop is before.backdrop
    assert after.environment is before.environment
    assert after.look.mode is Mode.RATIO


@pytest.mark.parametrize("stem", [LIT_BY_BACKGROUND, "studio", "background!", "s" * 80])
def test_a_file_takes_no_name_that_means_something_else(stem: str, director: Director, tmp_path: Path) -> None:
    path = tmp_path / f"{stem}.exr"
    write_linear(path, np.full((32, 64, 3), 0.5, np.float32))
    name = director.admit_environment(str(path))
    assert name not in {LIT_BY_BACKGROUND, *director.environments.names()}
    environment = director.set_look(Look(lighting=Lighting(environment=name))).environment
    assert environment is director.guest_environments()[name]


def test_subjects_by_path_by_name_and_none(director: Director, tmp_path: Path) -> None:
    path = tmp_path / "me.relit"
    write_subject(path, small_subject())
    assert director.set_subject(str(path)).subject_name == "me"
    director.subjects.folder.mkdir(parents=True)
    shutil.copy(path, director.subjects.folder / "stored.relit")
    assert director.set_subject("stored").subject is not None
    kept = director.scene
    path.write_bytes(b"damaged")
    for wrong, error in ((str(path), SubjectError), ("nobody", NotFoundError)):
        with pytest.raises(error):
            director.set_subject(wrong)
    assert director.scene is kept
    assert director.set_subject(None).subject is None


def test_changes_from_many_threads_are_all_made(director: Director) -> None:
    director.set_look(Look(lighting=Lighting(exposure_ev=0)))

    def brighten() -> None:
        for _ in range(50):
            director.update_look(
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
    assert director.scene.look.lighting.exposure_ev == pytest.approx(2.0)
    assert director.scene.revision == 201


def test_background_names(director: Director) -> None:
    director.backgrounds.add("beach", cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    assert {"beach", "studio"} <= set(director.background_names())
