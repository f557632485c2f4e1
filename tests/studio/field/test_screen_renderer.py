"""A person before a screen: where its patches are, and what lies beside the pictures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import OpenEXR
import pytest

from relit_camera.base.errors import DeviceError, InputError
from relit_camera.capture.desk.person.patch_light import place_patches
from relit_camera.capture.picture_import import import_samples
from relit_camera.lab.evaluate.desk_simulation import LAPTOP, MONITOR
from relit_studio.cycles.job import PatchLight, Picture, Quality
from relit_studio.field import screen_renderer
from relit_studio.field.screen_renderer import ScreenSettings, face_middle_cm, render_screen
from relit_studio.people.traits.named_people import find_traits

MIDDLE = np.array([1.0, 2.0, 10.0])
SETTINGS = ScreenSettings(64, Quality(4))


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Somebody whose face is a disc that bulges toward the camera, and whom nobody needs Cycles to see."""
    y, x = np.mgrid[-1:1:26j, -1:1:18j]
    points = np.stack([5 * x, 8 * y, -2 * (x**2 + y**2)], axis=-1).reshape(-1, 3) + MIDDLE
    irises = np.full((10, 3), 99.0)
    monkeypatch.setattr(screen_renderer, "landmarks", lambda *who: {"mesh478": np.concatenate([points, irises])})
    monkeypatch.setattr(screen_renderer, "Figure", lambda who: SimpleNamespace(scene=lambda: None))
    monkeypatch.setattr(screen_renderer, "render", rendered)
    monkeypatch.setattr(screen_renderer, "read_rgba", lambda path: (None, np.ones((64, 64), np.float32)))
    return SimpleNamespace(traits=find_traits("cem"))


def rendered(
    scene: object, camera: object, quality: object, pictures: Sequence[Picture], *more: object
) -> dict[str, float]:
    """Instead of Cycles: each picture shows where its patch is."""
    for picture in pictures:
        assert isinstance(picture.light, PatchLight)
        place = (np.array(picture.light.center_cm) + 100) / 200
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        shown = np.ascontiguousarray(np.broadcast_to(place, (64, 64, 3)), np.float32)
        OpenEXR.File(header, {"RGB": shown}).write(str(picture.path))
    return {picture.path.name: 1.0 for picture in pictures}


def test_the_middle_of_the_face_is_that_of_its_outline_at_its_mean_depth(person: Any) -> None:
    found = face_middle_cm(person)
    np.testing.assert_allclose(found[:2], MIDDLE[:2])
    assert MIDDLE[2] - 2 < found[2] < MIDDLE[2]


@pytest.mark.parametrize("setup", [MONITOR, LAPTOP])
def test_patches_stand_before_the_face_in_the_order_of_the_capture(person: Any, setup: Any, tmp_path: Path) -> None:
    seconds = render_screen(person, setup, tmp_path / "screen", SETTINGS)
    assert len(seconds) == setup.patches.count
    samples = import_samples(tmp_path / "screen" / "lights.lp")
    patches = place_patches(setup)
    np.testing.assert_allclose(samples.directions, patches.directions, atol=1e-6)
    centers = samples.pictures[:, 0, 0] * 200 - 100
    np.testing.assert_allclose(centers, patches.centers_cm + face_middle_cm(person), atol=0.2)
    assert samples.matte.min() == 1
    assert (tmp_path / "screen" / "matte.png").is_file()
    said = json.loads((tmp_path / "screen" / "screen.json").read_text())
    assert said["setup"]["distance_cm"] == setup.distance_cm
    assert said["person"]["name"] == "cem"


def test_a_folder_of_other_settings_is_left_alone(person: Any, tmp_path: Path) -> None:
    render_screen(person, MONITOR, tmp_path, SETTINGS)
    with pytest.raises(InputError, match="other settings"):
        render_screen(person, LAPTOP, tmp_path, SETTINGS)


def test_a_rendering_that_is_broken_off_lists_no_pictures(person: Any, tmp_path: Path, monkeypatch: Any) -> None:
    def broken_off(*arguments: object) -> dict[str, float]:
        raise DeviceError("Cycles failed", "see what it says")

    monkeypatch.setattr(screen_renderer, "render", broken_off)
    with pytest.raises(DeviceError):
        render_screen(person, MONITOR, tmp_path, SETTINGS)
    assert not (tmp_path / "lights.lp").exists()
