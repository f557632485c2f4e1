"""What an edited configuration changes while the camera runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.app.config_reload import apply_edited_settings
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.base.errors import ConfigError, RelitError
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.subject.subject_file import write_subject
from tests.generated_subject import small_subject


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("me", "other"):
        write_subject(tmp_path / f"{name}.relit", small_subject())
    return tmp_path


def settings(folder: Path, text: str) -> RelitSettings:
    path = folder / "mine.yaml"
    path.write_text(f"storage: {{data_dir: {folder}}}\n{text}", encoding="utf-8")
    return load_settings(path)


def started(folder: Path, text: str) -> tuple[SceneController, RelitSettings]:
    before = settings(folder, text)
    scene_controller = SceneController(before.storage)
    scene_controller.set_look(before.look)
    scene_controller.load_configured_subject(before.subject)
    return scene_controller, before


def test_an_edit_of_which_half_cannot_be_used_changes_nothing(folder: Path) -> None:
    scene_controller, before = started(folder, f"subject: {folder}/me.relit")
    scene = scene_controller.scene
    for text, error in (
        (f"subject: {folder}/nobody.relit\nlook: {{lighting: {{yaw_deg: 70}}}}", "nobody"),
        (f"subject: {folder}/other.relit\nlook: {{lighting: {{environment: nowhere}}}}", "nowhere"),
    ):
        with pytest.raises(RelitError, match=error):
            apply_edited_settings(scene_controller, before, before, settings(folder, text))
        assert scene_controller.scene is scene


@pytest.mark.parametrize("subject", ["FOLDER/me.relit", "null"])
def test_a_subject_that_is_no_longer_named_stays(folder: Path, subject: str) -> None:
    """An editor that writes an empty file, or a line that was lost, must not show the room."""
    scene_controller, before = started(folder, f"subject: {subject.replace('FOLDER', str(folder))}")
    scene = scene_controller.scene
    with pytest.raises(ConfigError, match="no longer names the subject"):
        apply_edited_settings(scene_controller, before, before, settings(folder, ""))
    assert scene_controller.scene is scene
    assert apply_edited_settings(scene_controller, before, before, settings(folder, "subject: null")) is None
    assert scene_controller.scene.subject is None


def test_what_was_not_edited_stays_as_it_was_set(folder: Path) -> None:
    scene_controller, before = started(folder, "look: {lighting: {environment: studio}}")
    scene_controller.update_look(
        lambda look: look.model_copy(
            update={"lighting": look.lighting.model_copy(update={"environment": "sunset", "saturation": 0.5})}
        )
    )
    after = settings(folder, "look: {lighting: {environment: studio, yaw_deg: 70}}\noutput: {fps: 25}")
    note = apply_edited_settings(scene_controller, before, before, after)
    assert "output counts from the next start" in str(note)
    lighting = scene_controller.scene.look.lighting
    assert (lighting.environment, lighting.saturation, lighting.yaw_deg) == ("sunset", 0.5, 70)
    assert apply_edited_settings(scene_controller, before, after, before) is None
    assert scene_controller.scene.look.lighting.yaw_deg == 0


def test_another_subject_is_shown(folder: Path) -> None:
    scene_controller, before = started(folder, f"subject: {folder}/me.relit")
    assert (
        apply_edited_settings(scene_controller, before, before, settings(folder, f"subject: {folder}/other.relit"))
        is None
    )
    assert scene_controller.scene.subject_name == "other"
