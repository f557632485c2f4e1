"""Makes the next scene from what users change: looks up names, checks that the parts fit, and replaces the scene."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.config.look import (
    ANYONE,
    LEAST_RELIT_BLEND,
    Look,
    Mode,
)
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import (
    ConflictError,
    PreconditionFailedError,
    RelitError,
    UnlitNotAllowedError,
)
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_camera.live.scene.background_store import BackgroundStore
from relit_camera.live.scene.loading_changes import Loaded, load_and_change
from relit_camera.live.scene.look_loader import LookLoader
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_history import SceneHistory, ScenePoint, TakeStep
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_store import SubjectStore


@dataclass(frozen=True)
class ChosenSubject:
    """Who shall be shown.

    Attributes:
        name: of a stored subject, or of one whose file a person named; None for nobody.
        subject: the person, where that is loaded already.
    """

    name: str | None
    subject: Subject | None = None


class SceneController:
    """Holds the scene, and the stores of what it can show. Thread-safe: changes are made one at a time.

    A change that names something unknown raises an error and leaves the scene as it was. Files are read while nobody
    waits for the lock: what needs none, such as `unlit_allowed`, is never held up by a decoder.

    Attributes:
        scene: the present scene; reading it takes no lock.
        environments, subjects, backgrounds: the stores.
    """

    def __init__(self, storage: StorageSettings, clock: Clock = SYSTEM_CLOCK) -> None:
        """Set up; nothing is read. `clock` tells which changes are one step to undo."""
        environments = EnvironmentStore(storage.environments, apart=True)
        self._looks = LookLoader(environments, BackgroundStore(storage.backgrounds))
        self.environments, self.backgrounds = self._looks.environments, self._looks.backgrounds
        self.subjects = SubjectStore(storage.subjects, copied=True)
        self._change = threading.Lock()
        self._history = SceneHistory(clock)
        self._subject_files: dict[str, Path] = {}
        self.scene = Scene(Look())
        self._first = _point(self.scene)

    def change(
        self,
        look: Callable[[Look], Look] | None = None,
        subject: ChosenSubject | None = None,
        frozen: bool | None = None,
        unlit_allowed: bool | None = None,
        avatar_allowed: bool | None = None,
        if_revision: Collection[int] | None = None,
        recorded: bool = True,
    ) -> Scene:
        """Change the scene, all of it in one step or nothing. What is None stays.

        Where `unlit_allowed` becomes false, nothing of the look stays that shows the picture as filmed. That others may
        move the portrait is said of one person: where another one is chosen, it is said no more.

        Args:
            look: makes the next look of the present one; it is called again where files had to be read first.
            subject: who is shown.
            frozen: whether the published picture is held.
            unlit_allowed: whether the picture as filmed may be published.
            avatar_allowed: whether others may move the subject's portrait.
            if_revision: revisions for which the change is meant; any if not given.
            recorded: whether the change can be undone.

        Raises:
            PreconditionFailedError: the scene has another revision than those of `if_revision`.
            UnlitNotAllowedError: the look shows the picture as filmed, which is not allowed.
            NotFoundError: an environment, background or subject of that name is not stored.
            InputError: `background` as environment while the background cannot light.
            SubjectError: the subject's file is damaged.
            NotReadyError: the decoder of files is busy, or has too little memory.
        """

        def made(loaded: Loaded) -> Scene:
            now = self.scene
            if if_revision is not None and now.revision not in if_revision:
                raise PreconditionFailedError(
                    f"the scene has changed: its revision is {now.revision}", "read it again, then change it"
                )
            allowed = now.unlit_allowed if unlit_allowed is None else unlit_allowed
            before = now.look if allowed else now.look.relit()
            wanted = before if look is None else look(before)
            if not allowed and wanted.shows_filmed:
                raise UnlitNotAllowedError(
                    "part of the picture would be published as it is filmed, and nobody has allowed that",
                    "allow it with the same change (unlit_allowed), or leave split at 0 and blend at "
                    f"{LEAST_RELIT_BLEND} or more",
                )
            changes = {} if wanted is now.look else self._with_look(wanted, loaded)
            avatar = now.avatar_allowed
            if subject is not None:
                person = self._subject(subject, loaded)
                changes |= {"subject_name": subject.name, "subject": person}
                avatar = avatar and _is_same_person(person, now.subject)
            changes["avatar_allowed"] = avatar if avatar_allowed is None else avatar_allowed
            if frozen is not None:
                changes["frozen"] = frozen
            return self._show(self._next(unlit_allowed=allowed, **changes), recorded)

        return load_and_change(self._change, made)

    def set_look(self, look: Look) -> Scene:
        """Show another lighting, background or mode.

        Raises:
            RelitError: as `change`.
        """
        return self.change(lambda _: look)

    def update_look(self, change: Callable[[Look], Look], recorded: bool = True) -> Scene:
        """Show what `change` makes of the present look.

        Raises:
            RelitError: as `change`.
        """
        return self.change(change, recorded=recorded)

    def choose_stored_subject(self, name: str | None, mode: Mode | None = None) -> Scene:
        """Show a stored subject, one whose file the command line named, or none. For names from the API.

        With `mode` the mode changes in the same step; then all of the picture is relit, unless it may be as filmed.

        Raises:
            NotFoundError: no stored subject has that name.
            SubjectError: its file is damaged.
        """

        def in_mode(look: Look) -> Look:
            changed = look if mode is None else look.model_copy(update={"mode": mode})
            return changed if self.scene.unlit_allowed else changed.relit()

        return self.change(in_mode, ChosenSubject(name))

    def rename_stored_subject(self, name: str, new_name: str) -> Scene:
        """Give a stored subject another name; where it is shown, it stays so under that name.

        Raises:
            NotFoundError: no stored subject has that name.
            ConflictError: there is one of the new name.
            InputError: the new name is not allowed.
            StorageError: it cannot be renamed.
        """
        with self._change:
            self.subjects.rename(name, new_name)
            self._history.rename_subject(name, new_name)
            self._first = self._first.with_renamed(name, new_name)
            return self._show(self._next(subject_name=new_name)) if self.scene.subject_name == name else self.scene

    def load_configured_subject(self, name_or_path: str | None) -> Scene:
        """Show the subject that the command line or the configuration names: a stored one, else a file; or none.

        Raises:
            NotFoundError: neither a stored name nor a file.
            SubjectError: the file is damaged.
        """
        return self.change(subject=self.resolve_subject(name_or_path))

    def resolve_subject(self, name_or_path: str | None) -> ChosenSubject:
        """The subject that a person named outside the API: a stored one, else a file; or none.

        A file's subject can then be chosen by the name that it is given here, as long as this program runs.

        Raises:
            NotFoundError: neither a stored name nor a file.
            SubjectError: the file is damaged.
        """
        if name_or_path in (None, ANYONE):
            return ChosenSubject(name_or_path)
        assert name_or_path is not None
        name, subject = self.subjects.resolve(name_or_path)
        if name_or_path not in self.subjects.names():
            if name in self.subjects.names():
                name += "-file"
            self._subject_files[name] = Path(name_or_path)
        return ChosenSubject(name, subject)

    def show_subject(self, name: str, subject: Subject) -> Scene:
        """Show a subject that is not stored, under `name`."""
        return self.change(subject=ChosenSubject(name, subject))

    def subject_files(self) -> list[str]:
        """Names of the subjects that are not stored, and can be chosen because a person named their files."""
        return list(self._subject_files)

    def subject_path(self, name: str) -> Path:
        """The file of a subject that can be chosen.

        Raises:
            NotFoundError: there is none of that name.
        """
        stored = self.subjects.names()
        return (
            self._subject_files[name]
            if name in self._subject_files and name not in stored
            else self.subjects.path(name)
        )

    def set_frozen(self, frozen: bool) -> Scene:
        """Hold the published picture, or continue."""
        return self.change(frozen=frozen)

    def set_unlit_allowed(self, allowed: bool) -> Scene:
        """Say whether the picture as filmed may be published."""
        return self.change(unlit_allowed=allowed)

    def set_avatar_allowed(self, allowed: bool) -> Scene:
        """Say whether others may move the subject's portrait."""
        return self.change(avatar_allowed=allowed)

    def mark_start(self) -> None:
        """Make the present scene the one that `reset` brings back, and forget the steps before it."""
        with self._change:
            self._first = _point(self.scene)
            self._history.clear()
            self.scene = replace(self.scene, can_undo=False, can_redo=False)

    def undo(self) -> Scene:
        """Take the last step back. No more is allowed after it than before.

        Raises:
            ConflictError: there is nothing to undo.
            RelitError: what was shown then is not stored any more; the step is dropped.
        """
        return self._step(self._history.undo, ConflictError("there is nothing to undo", "change something first"))

    def redo(self) -> Scene:
        """Do the step again that was undone last. No more is allowed after it than before.

        Raises:
            ConflictError: there is nothing to do again.
            RelitError: what was shown then is not stored any more; the step is dropped.
        """
        return self._step(self._history.redo, ConflictError("there is nothing to do again", "undo something first"))

    def reset(self) -> Scene:
        """Show what the settings say, as at the first start; it can be undone.

        Where they name no subject, whoever is shown stays. No more is allowed after it than before.

        Raises:
            RelitError: what the settings name is not stored any more.
        """

        def made(loaded: Loaded) -> Scene:
            named = self._first.subject_name
            name = self.scene.subject_name if named in (None, ANYONE) else named
            first = self._restored(replace(self._first, subject_name=name), loaded)
            self._history.note(_point(self.scene), _point(first), own_step=True)
            return self._show(replace(first, frozen=False))

        return load_and_change(self._change, made)

    def _step(self, take: TakeStep[Scene], nothing: ConflictError) -> Scene:
        """Show the scene that a step of the history leads to; raises `nothing` where there is no step."""

        def made(loaded: Loaded) -> Scene:
            try:
                restored = take(_point(self.scene), lambda point: self._restored(point, loaded))
            except RelitError:
                self._show(self._next())  # the same, but the step was dropped: there may be none left
                raise
            if restored is None:
                raise nothing
            return self._show(restored)

        return load_and_change(self._change, made)

    def _restored(self, point: ScenePoint, loaded: Loaded) -> Scene:
        """The next scene, with what `point` says of it; no more is allowed than before."""
        now = self.scene
        avatar = now.avatar_allowed and point.avatar_allowed and point.subject_name == now.subject_name
        allowed = now.unlit_allowed and point.unlit_allowed
        changes = self._with_look(point.look if allowed else point.look.relit(), loaded)
        if point.subject_name != now.subject_name:
            subject = self._subject(ChosenSubject(point.subject_name), loaded)
            changes |= {"subject_name": point.subject_name, "subject": subject}
        return self._next(unlit_allowed=allowed, avatar_allowed=avatar, **changes)

    def _subject(self, chosen: ChosenSubject, loaded: Loaded) -> Subject | None:
        """Who is chosen; breaks off where their file must be read first (`Loaded.ask_for`).

        Raises:
            RelitError: it cannot be.
        """
        name = chosen.name
        if name in (None, ANYONE) or chosen.subject is not None:
            return chosen.subject
        assert name is not None
        loaded.require_usable(name)
        path = self.subject_path(name)
        if name not in loaded.subjects:

            def load(into: Loaded) -> None:
                into.subjects[name] = self.subjects.load_file(path)[1]

            loaded.ask_for(name, load)
        return loaded.subjects[name]

    def register_temporary_environment(self, name_or_path: str) -> str:
        """Make the environment of a file available under a name, for this run only; see `LookLoader.register`.

        Raises:
            NotFoundError: neither a stored name nor a file.
            PanoramaError: the file cannot be used as light.
        """
        return self._looks.register(name_or_path)

    def temporary_environments(self) -> dict[str, Environment]:
        """The environments registered from files for this run, by name."""
        return self._looks.temporary_environments()

    def background_names(self) -> list[str]:
        """The names that an `image` background may use: stored pictures and environments."""
        return self._looks.background_names()

    def _with_look(self, look: Look, loaded: Loaded) -> dict[str, object]:
        """The fields of a scene with that look; breaks off where a file must be read first (`Loaded.ask_for`).

        Raises:
            RelitError: it cannot be.
        """
        before = self.scene
        wanted = look.lighting.environment, look.background
        loaded.require_usable(wanted)
        changes = self._looks.loaded(look, (before, *loaded.scenes))
        if changes is None:

            def load(into: Loaded) -> None:
                into.scenes.append(replace(before, **self._looks.load(look, before)))  # type: ignore[arg-type]

            loaded.ask_for(wanted, load)
        return changes if look.mode is before.look.mode else changes | {"mode_revision": before.revision + 1}

    def _next(self, **changes: object) -> Scene:
        return replace(self.scene, **changes, revision=self.scene.revision + 1)  # type: ignore[arg-type]

    def _show(self, scene: Scene, recorded: bool = False) -> Scene:
        if recorded:
            self._history.note(_point(self.scene), _point(scene))
        self.scene = replace(scene, can_undo=self._history.can_undo, can_redo=self._history.can_redo)
        return self.scene


def _point(scene: Scene) -> ScenePoint:
    return ScenePoint(scene.look, scene.subject_name, scene.unlit_allowed, scene.avatar_allowed)


def _is_same_person(subject: Subject | None, other: Subject | None) -> bool:
    """Whether both are of one capture: its file may have been renamed, or given other stills."""
    return subject is not None and other is not None and subject.metadata == other.metadata
