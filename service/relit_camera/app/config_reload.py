"""Applies an edited configuration file to the running camera: look and subject at once, the rest at the next start."""

from __future__ import annotations

from functools import partial
from typing import Any

from relit_camera.base.config.look import Look, SettingsModel
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ConfigError
from relit_camera.live.scene.scene_controller import SceneController


def apply_edited_settings(
    scene_controller: SceneController, started: RelitSettings, before: RelitSettings, after: RelitSettings
) -> ConfigError | None:
    """Show what an edit changed of the look and the subject.

    Args:
        scene_controller: holds the scene.
        started: the settings with which the camera was started.
        before: the settings before this edit.
        after: the settings after it.

    Returns:
        What a person should know: that some of the edit takes effect at the next start only. None if nothing.

    Raises:
        RelitError: something that the edit names does not exist, or cannot be used; then nothing is changed.
    """
    if after.subject is None and before.subject is not None and "subject" not in after.model_fields_set:
        # An edit that only lost this line would otherwise show the live picture with the room.
        raise ConfigError("it no longer names the subject", "name one, or write 'subject: null' for the live picture")
    chosen = scene_controller.subjects.resolve(after.subject) if after.subject not in (None, before.subject) else None
    if after.look != before.look:
        scene_controller.update_look(partial(_merge_edits, before=before.look, after=after.look))
    if chosen is not None:
        scene_controller.show_subject(*chosen)
    elif after.subject is None and before.subject is not None:
        scene_controller.choose_stored_subject(None)
    fixed = [name for name in RelitSettings.model_fields if name not in ("look", "subject")]
    later = [name for name in fixed if getattr(after, name) != getattr(started, name)]
    return ConfigError(f"what changed of {', '.join(later)} counts from the next start", "restart") if later else None


def _merge_edits(look: Look, before: Look, after: Look) -> Look:
    """The present look with every field that differs between `before` and `after`; in the lighting field by field."""
    lighting = look.lighting.model_copy(update=_changed_fields(before.lighting, after.lighting))
    parts = _changed_fields(before, after)
    return look.model_copy(update=parts | {"lighting": lighting})


def _changed_fields(before: SettingsModel, after: SettingsModel) -> dict[str, Any]:
    values = {name: getattr(after, name) for name in type(after).model_fields}
    return {name: value for name, value in values.items() if value != getattr(before, name)}
