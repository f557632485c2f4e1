"""The end of every capture beside the camera: a worker process makes the subject, it is stored, and shown."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from typing import TypeVar

from relit_camera.base.concurrency.worker_process import Progress, run_in_worker_process
from relit_camera.base.config.look import Mode
from relit_camera.base.errors import ConflictError, StorageError, WorkerError
from relit_camera.base.storage.atomic_files import remove_unfinished_files
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.subject.rungs import Rung
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import SUFFIX
from relit_camera.subject.subject_store import SubjectStore

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

    def shown(self) -> Subject | None:
        """Who is shown now: to be noted when a capture begins."""
        return self._scene_controller.scene.subject

    def make(
        self,
        name: str,
        before: Subject | None,
        build: Callable[..., T],
        *arguments: object,
        timeout_s: float,
        canceled: threading.Event,
        progress: Progress | None = None,
        most_bytes: int | None = None,
    ) -> T:
        """Store what `build` makes, and show it in mode ratio unless somebody has chosen another one meanwhile.

        Nothing is stored, and nothing unfinished is left, unless this returns.

        Args:
            name: under which the subject is stored; one of that name is replaced.
            before: who was shown when the capture began.
            build: a function of a module, called in a worker process with the arguments and the path to write to.
            arguments: come before the path.
            timeout_s: after which the worker is ended.
            canceled: ends it when it is set.
            progress: hears what `build` tells (see `run_in_worker_process`).
            most_bytes: memory that the worker may take.

        Returns:
            What `build` returns.

        Raises:
            RelitError: of `build`, or of the worker: it was canceled, took too long or too much memory, or died.
            StorageError: the file cannot be written.
        """
        subjects = self._scene_controller.subjects
        limits = {"timeout_s": timeout_s, "canceled": canceled, "progress": progress, "most_bytes": most_bytes}
        try:
            with subjects.replacing(name, SUFFIX) as path:
                try:
                    result: T = run_in_worker_process(build, *arguments, path, **limits)  # type: ignore[arg-type]
                except StorageError as error:  # names the temporary file
                    raise StorageError(error.what.replace(path.name, f"{name}{SUFFIX}"), error.cure) from error
                if canceled.is_set():
                    raise WorkerError("the work was canceled", "start it again")
        except BaseException:
            remove_unfinished_files(subjects.folder)  # of a worker that was killed
            raise
        self._events.publish("collection", name="subjects")
        if self.shown() is before:
            self._scene_controller.choose_stored_subject(name, Mode.RATIO)
        return result
