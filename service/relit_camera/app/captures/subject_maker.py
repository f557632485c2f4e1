"""The end of every capture beside the camera: a worker process makes or changes a subject, it is stored, and shown."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from relit_camera.base.concurrency.worker_process import Progress, run_in_worker_process
from relit_camera.base.config.look import Mode
from relit_camera.base.errors import ConflictError, RelitError, StorageError, SubjectError, WorkerError
from relit_camera.base.storage.atomic_files import remove_unfinished_files
from relit_camera.base.storage.folder_redaction import redact_folders
from relit_camera.base.storage.named_files import file_version
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.subject.rungs import Rung
from relit_camera.subject.subject_file import SUFFIX
from relit_camera.subject.subject_store import SubjectStore

log = logging.getLogger(__name__)

T = TypeVar("T")


def require_replaceable(
    subjects: SubjectStore, name: str, rungs: Collection[Rung], cure: str = "choose another name"
) -> None:
    """Check that a subject may be stored under a name: there is none, or one that was captured in one of these ways.

    Raises:
        ConflictError: there is one that was captured in another way; `cure` says what to do.
        InputError: the name is not allowed, or what is stored there is no subject.
    """
    subjects.require_free_name(name)
    if name in subjects.names() and subjects.metadata(name).rung not in rungs:
        raise ConflictError(f"subject '{name}' was captured in a better way", cure)


class SubjectMaker:
    """Has worker processes make subjects, and stores and shows these. Thread-safe."""

    def __init__(self, scene_controller: SceneController, events: EventHub) -> None:
        """Set up.

        Args:
            scene_controller: holds the store, and shows the subjects.
            events: hears `collection` with each new subject.
        """
        self._scene_controller, self._events = scene_controller, events

    def shown(self) -> Scene:
        """What is shown now: to be noted when a capture begins."""
        return self._scene_controller.scene

    def make(
        self,
        name: str,
        replaced: Collection[Rung],
        before: Scene,
        build: Callable[..., T],
        *arguments: object,
        timeout_s: float,
        canceled: threading.Event,
        progress: Progress | None = None,
        most_bytes: int | None = None,
    ) -> tuple[T, str]:
        """Store what `build` makes, and show it unless somebody has chosen another one meanwhile.

        It is shown in mode live, unless somebody has chosen another mode meanwhile. Nothing is stored, and nothing
        unfinished is left, unless this returns.

        Args:
            name: under which the subject is stored; one of that name is replaced.
            replaced: how a subject of that name may have been captured, else it stays.
            before: what was shown when the capture began.
            build: a function of a module, called in a worker process with the arguments and the path to write to.
            arguments: come before the path.
            timeout_s: after which the worker is ended.
            canceled: ends it when it is set.
            progress: hears what `build` tells (see `run_in_worker_process`).
            most_bytes: memory that the worker may take.

        Returns:
            What `build` returns, and why the subject is stored but cannot be shown: empty where that is not so.

        Raises:
            ConflictError: a subject of that name was stored meanwhile that was captured in a better way.
            RelitError: of `build`, or of the worker: it was canceled, took too long or too much memory, or died.
            StorageError: the file cannot be written.
        """
        subjects = self._scene_controller.subjects
        limits = {"timeout_s": timeout_s, "canceled": canceled, "progress": progress, "most_bytes": most_bytes}
        with self._written(name, build, arguments, limits) as result:
            require_replaceable(subjects, name, replaced, "rename or delete that one, then start again")
        self._events.publish("collection", name="subjects")
        now = self.shown()
        if now.has_same_subject(before):
            mode = Mode.LIVE if now.mode_revision == before.mode_revision else None
            try:
                self._scene_controller.choose_stored_subject(name, mode)
            except RelitError as error:
                log.warning("subject '%s' cannot be shown: %s", name, error)
                return result, redact_folders(f"subject '{name}' is stored, but cannot be shown: {error}")
        return result, ""

    def change(
        self,
        name: str,
        build: Callable[..., T],
        *arguments: object,
        timeout_s: float,
        canceled: threading.Event,
        progress: Progress | None = None,
        most_bytes: int | None = None,
    ) -> tuple[T, str]:
        """Replace the file of a stored subject by what `build` makes of it, and show it anew where it is shown.

        The file stays as it is, and nothing unfinished is left, unless this returns.

        Args:
            name: of the subject.
            build: as of `make`; the last argument but the path is the subject's file.
            arguments: come before these two.
            timeout_s: after which the worker is ended.
            canceled: ends it when it is set.
            progress: hears what `build` tells.
            most_bytes: memory that the worker may take.

        Returns:
            As `make`.

        Raises:
            NotFoundError: there is no such stored subject.
            ConflictError: it was replaced, renamed or deleted meanwhile.
            RelitError, StorageError: as `make`.
        """
        subjects = self._scene_controller.subjects
        limits = {"timeout_s": timeout_s, "canceled": canceled, "progress": progress, "most_bytes": most_bytes}
        source = subjects.path(name)
        version = file_version(source)

        def is_same() -> bool:
            try:
                return file_version(source) == version
            except OSError:
                return False

        changed = ConflictError(f"subject '{name}' was changed or deleted meanwhile", "start again")
        try:
            with self._written(name, build, (*arguments, source), limits) as result:
                if not is_same():
                    raise changed
        except SubjectError as error:
            if not is_same():  # perhaps it could not be read because of that
                raise changed from error
            raise
        self._events.publish("collection", name="subjects")
        if self.shown().subject_name == name:
            try:
                self._scene_controller.choose_stored_subject(name)
            except RelitError as error:
                log.warning("subject '%s' cannot be shown anew: %s", name, error)
                return result, redact_folders(f"subject '{name}' is stored, but cannot be shown: {error}")
        return result, ""

    @contextmanager
    def _written(
        self, name: str, build: Callable[..., T], arguments: Sequence[object], limits: Mapping[str, Any]
    ) -> Iterator[T]:
        """Have a worker process write a subject's file, which replaces that of the name when the block ends.

        Raises:
            RelitError: of `build`, or of the worker.
            StorageError: the file cannot be written.
        """
        subjects = self._scene_controller.subjects
        with subjects.replacing(name, SUFFIX) as path:
            try:
                result = run_in_worker_process(build, *arguments, path, **limits)
            except StorageError as error:  # names the temporary file
                raise StorageError(error.what.replace(path.name, f"{name}{SUFFIX}"), error.cure) from error
            finally:
                remove_unfinished_files(subjects.folder, path)  # of a worker that was killed
            if limits["canceled"].is_set():
                raise WorkerError("the work was canceled", "start it again")
            yield result
