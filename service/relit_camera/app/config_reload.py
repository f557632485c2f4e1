"""Applies an edited configuration file to the running camera: look and subject at once, the rest at the next start."""

from __future__ import annotations

from functools import partial

from relit_camera.base.config.look import merge_edits
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
    if after.subject != before.subject and "subject" not in after.model_fields_set:
        # An edit that only lost this line would otherwise show whoever comes.
        raise ConfigError("it no longer names the subject", "name one, or write 'subject: null' for nobody")
    chosen = scene_controller.resolve_subject(after.subject) if after.subject != before.subject else None
    if after.look != before.look or chosen is not None:
        scene_controller.change(partial(merge_edits, before=before.look, after=after.look), chosen)
    fixed = [name for name in RelitSettings.model_fields if name not in ("look", "subject")]
    later = [name for name in fixed if getattr(after, name) != getattr(started, name)]
    return ConfigError(f"what changed of {', '.join(later)} counts from the next start", "restart") if later else None
