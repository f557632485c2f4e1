"""The first scene of a run: what the settings say, then what the last run showed or a preset, then the command line.

Where none of them names anybody it is whoever comes; but who chose to be nobody stays so until somebody is chosen.
While the camera runs its look and subject are written to a file, at most once a second.
"""

from __future__ import annotations

import logging
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from relit_camera.base.config.look import ANYONE, EnvironmentBackground, Look, SettingsModel, merge_edits
from relit_camera.base.config.preset_store import PresetStore
from relit_camera.base.config.settings import RelitSettings, StorageSettings
from relit_camera.base.errors import NotReadyError, RelitError
from relit_camera.base.safe_yaml import MAX_YAML_BYTES, parse_yaml, yaml_text
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import ChosenSubject, SceneController

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class GivenOptions:
    """Which options of the command line are about the first scene: they win over what was kept.

    Attributes:
        subject: whether the settings' subject is the command line's.
        mode: whether the settings' mode is.
    """

    subject: bool = False
    mode: bool = False


class KeptScene(SettingsModel):
    """The file that keeps a run's look and subject, and what the configuration said meanwhile.

    What the configuration says by the next start in another way is an edit, and wins.
    """

    look: Look
    subject: str | None = None
    """A stored subject, or null for nobody; left out where the one shown is not stored."""
    configured_look: Look = Look()
    configured_subject: str | None = None


def kept_scene_path(storage: StorageSettings) -> Path:
    """The file of the data folder in which the last run's look and subject are kept."""
    return storage.data_dir / "last-scene.yaml"


def read_kept_scene(path: Path) -> KeptScene | None:
    """What the last run kept; None where there is no such file.

    A damaged one, which the log names, has the defaults, and nobody: that may have been chosen.
    """
    try:
        if path.stat().st_size > MAX_YAML_BYTES:
            raise ValueError(f"it is larger than {MAX_YAML_BYTES >> 20} MiB")
        return KeptScene.model_validate(parse_yaml(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.warning("the last run's look is not shown, since %s cannot be read: %s", path.name, error)
        return KeptScene(look=Look(), subject=None)


def show_first_scene(
    scene_controller: SceneController,
    settings: RelitSettings,
    environment: str | None = None,
    instant: bool = False,
    given: GivenOptions | None = None,
) -> None:
    """Show what a run begins with.

    Args:
        scene_controller: holds the scene. What `reset` brings back is what the settings say.
        settings: of this run.
        environment: a stored environment's name or a panorama file, instead of the one in the settings.
        instant: show nobody: a subject is captured first.
        given: the options of the command line, where the last run's look or the preset at start is to be shown; None
            shows what the settings say.

    Raises:
        RelitError: something that the settings or the command line name cannot be used.
    """
    unlit_allowed = settings.output.unlit_allowed and not instant
    scene_controller.set_unlit_allowed(unlit_allowed)
    look = settings.look
    if environment is not None:
        try:
            environment = scene_controller.register_temporary_environment(environment)
            look = _in_environment(look, environment)
        except NotReadyError as error:
            log.warning("'%s' lights nobody: %s", Path(environment).name, error)
            environment = None
    if look.shows_filmed and not unlit_allowed:
        log.warning("all of the picture is relit: split and blend count where output.unlit_allowed is true (--unlit)")
        look = look.relit()
    try:
        scene_controller.set_look(look)
    except NotReadyError as error:
        log.warning("the first look has no environment and no background picture: %s", error)
        scene_controller.set_look(
            _in_environment(look.model_copy(update={"background": EnvironmentBackground()}), None)
        )
    scene_controller.load_configured_subject(None if instant else settings.subject)
    scene_controller.set_avatar_allowed(settings.output.avatar_allowed and not instant)
    scene_controller.mark_start()
    if given is not None:
        _show_kept(scene_controller, settings, environment, instant, given)
    scene = scene_controller.scene
    if scene.subject_name == ANYONE and not scene.shows_nobody:
        log.info("whoever comes is relit; to hide them choose Nobody in the panel, or write 'subject: null'")


def _show_kept(
    scene_controller: SceneController,
    settings: RelitSettings,
    environment: str | None,
    instant: bool,
    given: GivenOptions,
) -> None:
    look, subject = scene_controller.scene.look, None
    kept = read_kept_scene(kept_scene_path(settings.storage))
    if kept is not None:
        before = kept.configured_look
        if "mode" not in settings.look.model_fields_set:
            # A default that another version changed is no edit: whoever chose portrait stays hidden behind it.
            before = before.model_copy(update={"mode": settings.look.mode})
        look = merge_edits(kept.look, before=before, after=settings.look)
        if "subject" in kept.model_fields_set and not _is_edited(settings, kept):
            subject = ChosenSubject(kept.subject)
    presets = PresetStore(settings.storage.presets)
    try:
        at_start = presets.at_start()
        if at_start is not None:
            preset = presets.load(at_start)
            look = preset.look
            subject = subject if preset.subject is None else ChosenSubject(preset.subject)
    except RelitError as error:
        log.warning("the preset at start is not shown: %s", error)
    if given.mode:
        look = look.model_copy(update={"mode": settings.look.mode})
    if environment is not None:
        look = _in_environment(look, environment)
    if instant or given.subject:
        subject = None
    elif (
        subject is not None
        and not _show_or_say(scene_controller, None, subject)
        and scene_controller.scene.subject_name == ANYONE
    ):
        # Who chose to be shown as a captured face did not choose the live picture.
        scene_controller.change(subject=ChosenSubject(None), recorded=False)
    if not _show_or_say(scene_controller, look, None):
        places = {"background": settings.look.background}
        _show_or_say(
            scene_controller,
            _in_environment(look.model_copy(update=places), scene_controller.scene.look.lighting.environment),
            None,
        )


def _is_edited(settings: RelitSettings, kept: KeptScene) -> bool:
    """Whether the configuration names a subject otherwise than it did in the last run."""
    if "subject" not in settings.model_fields_set and None in (kept.subject, kept.configured_subject):
        return False  # a line that is gone, or a default that another version changed, shows nobody who was hidden
    return settings.subject != kept.configured_subject


def _show_or_say(scene_controller: SceneController, look: Look | None, subject: ChosenSubject | None) -> bool:
    """Show it, all of it relit unless it may be as filmed. Returns whether it could be; the log says why not."""
    scene = scene_controller.scene
    if look is not None and not scene.unlit_allowed:
        look = look.relit()
    change = None if look is None else lambda _: look
    try:
        # What the settings allow counts for whoever is shown first.
        scene_controller.change(change, subject, avatar_allowed=scene.avatar_allowed, recorded=False)
    except RelitError as error:
        log.warning("what was kept is not all shown: %s", error)
        return False
    return True


def _in_environment(look: Look, environment: str | None) -> Look:
    return look.model_copy(update={"lighting": look.lighting.model_copy(update={"environment": environment})})


class SceneKeeper:
    """Writes the look and the subject to a file whenever they have changed; `check` is to be called regularly."""

    def __init__(self, scene_controller: SceneController, settings: RelitSettings, given: GivenOptions) -> None:
        """Set up; nothing is written before something changes.

        Args:
            scene_controller: holds the scene.
            settings: of this run.
            given: options of the command line: what the configuration itself says there is not known.
        """
        self._scene_controller, self._path = scene_controller, kept_scene_path(settings.storage)
        before = read_kept_scene(self._path) or KeptScene(look=Look())
        look = settings.look
        if given.mode:
            look = look.model_copy(update={"mode": before.configured_look.mode})
        self._configured_look = look
        self._configured_subject = before.configured_subject if given.subject else settings.subject
        self._written: dict[str, object] | None = None
        self._written_revision: int | None = None
        scene = scene_controller.scene
        with suppress(RelitError, ValueError):  # `check` says why
            self._written = self._to_keep(scene)
            self._written_revision = scene.revision
        self._failed = False

    def check(self) -> None:
        """Write what is shown, if that is not what the file has. A failure is logged, and tried again later."""
        scene = self._scene_controller.scene
        if scene.revision == self._written_revision:
            return
        try:
            present = self._to_keep(scene)
            if present != self._written:
                make_folder(self._path.parent)
                write_atomic(self._path, yaml_text(present))
        except (RelitError, ValueError) as error:  # also a name that is no text, of a file that a person put there
            if not self._failed:
                log.warning("the look is not kept for the next start: %s", error)
            self._failed = True
            return
        self._written, self._written_revision, self._failed = present, scene.revision, False

    def _to_keep(self, scene: Scene) -> dict[str, object]:
        """What the file is to have of a scene.

        Raises:
            StorageError: the folder of subjects cannot be read.
            ValueError: the subject's name is no text that a file can keep.
        """
        kept = KeptScene(
            look=scene.look,
            subject=scene.subject_name,
            configured_look=self._configured_look,
            configured_subject=self._configured_subject,
        )
        stored = scene.subject_name in (None, ANYONE, *self._scene_controller.subjects.names())
        return kept.model_dump(mode="json", exclude=None if stored else {"subject"})
