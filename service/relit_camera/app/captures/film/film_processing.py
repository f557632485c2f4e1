"""A capture from a film beside the running camera: the film is received, a worker process makes a subject of it.

What is done so far is kept, as by `relit capture build`: after a stop, or a restart of the camera, the work goes on.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from relit_camera.app.background_job import BackgroundJob, StatusEvents, describe_failure
from relit_camera.app.captures.film.film_folder import (
    FilmFolder,
    FilmRecord,
    RecordedState,
    film_suffix,
    new_film_name,
)
from relit_camera.app.captures.film.film_progress import FilmProgress
from relit_camera.app.captures.subject_maker import SubjectMaker, require_replaceable
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import ConflictError, RelitError, StorageError
from relit_camera.base.storage.upload import Upload
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.film_status import FilmCaptureStatus, FilmOptions, FilmReport, FilmStage
from relit_camera.subject.rungs import Rung

log = logging.getLogger(__name__)

FilmBuilder = Callable[[Path, str, FilmOptions, Path, Path, Progress], FilmReport]
"""Builds a subject of a film, given its name, options, the folder for what is kept meanwhile, the subject's path, and
what to tell of the progress. It must be a function of a module, since another process imports it."""

REPLACED: tuple[Rung, ...] = ("instant", "desk", "film")
"""What a capture from a film may replace."""
PICTURE_PATH = "/api/v1/captures/film/pictures/{}.jpg"
STAGE_BY_STATE = {
    RecordedState.BEGUN: FilmStage.INTERRUPTED,
    RecordedState.DONE: FilmStage.DONE,
    RecordedState.FAILED: FilmStage.FAILED,
    RecordedState.CANCELED: FilmStage.CANCELED,
}


@dataclass(frozen=True)
class FilmLimits:
    """Limits of the work.

    Attributes:
        timeout_s: after which the worker is ended: a minute of film takes five, on a slow machine many more.
        most_bytes: memory that the worker may take; a minute at 1080p to 512 pixels a side takes 2.8 GB.
        event_interval_s: least time between two events of the same step.
    """

    timeout_s: float = 3600.0
    most_bytes: int = 6 << 30
    event_interval_s: float = 0.5


class FilmProcessing:
    """Implements `live.camera_control.FilmCaptureControl`. One capture at a time, in a thread of its own."""

    def __init__(
        self,
        folder: Path,
        scene_controller: SceneController,
        events: EventHub,
        build: FilmBuilder,
        limits: FilmLimits = FilmLimits(),
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up; what an earlier run of the camera has left is told by `status`.

        Args:
            folder: for the film and what is made of it.
            scene_controller: stores the subject and shows it.
            events: hears `film-capture` whenever the status changes.
            build: makes the subject's file.
            limits: of the work.
            clock: by which steps are timed.
        """
        self._files, self._scene_controller = FilmFolder(folder), scene_controller
        self._build, self._limits, self._clock = build, limits, clock
        self._maker = SubjectMaker(scene_controller, events)
        self._told = StatusEvents(events, "film-capture", limits.event_interval_s, clock)
        self._job = BackgroundJob("film-capture", "a capture from a film runs already")
        self._closing = threading.Event()
        self._record: FilmRecord | None = None
        self._status = FilmCaptureStatus()
        try:
            if self._files.take_if_there():
                self._look_at_what_is_kept()
        except StorageError as error:
            log.warning("the last film capture is not told: %s", error)

    def status(self) -> FilmCaptureStatus:
        """How far the last capture is."""
        return self._status

    @contextmanager
    def receive(self, name: str, file_name: str, options: FilmOptions) -> Iterator[Upload]:
        """Give a path to write a film to; see `FilmCaptureControl.receive`."""
        suffix = film_suffix(file_name)
        require_replaceable(self._scene_controller.subjects, name, REPLACED)
        with self._job.taken() as canceled:
            self._require_own_folder()
            record = FilmRecord(subject=name, file_name=file_name, film=new_film_name(suffix), options=options)
            status_before, record_before = self._status, self._record
            try:
                self._set(FilmCaptureStatus(FilmStage.RECEIVING, name, file_name))
                with self._files.receiving(record) as path:
                    upload = Upload(path, canceled, "the capture was canceled", "send the film again")
                    yield upload
                    upload.require_wanted()
                self._record = record
                self._begin(record, canceled)
            except BaseException:
                self._set(status_before if self._record is record_before else self._settled(record))
                raise

    def resume(self, options: FilmOptions | None = None) -> FilmCaptureStatus:
        """Go on with the film that is there; see `FilmCaptureControl.resume`."""
        with self._job.taken() as canceled:
            self._require_own_folder()
            if self._record is None or not self._status.can_resume:
                raise ConflictError("there is no film to go on with", "send one")
            require_replaceable(self._scene_controller.subjects, self._record.subject, REPLACED)
            changes = {"state": RecordedState.BEGUN, "what": "", "cure": "", "options": options or self._record.options}
            record = self._record.model_copy(update=changes)
            self._files.write(record)
            self._record = record
            self._begin(record, canceled)
            return self._status

    def cancel(self, forget: bool = False) -> FilmCaptureStatus:
        """End the capture that runs, if one does; see `FilmCaptureControl.cancel`."""
        self._job.cancel()
        if forget:
            with self._job.lock:
                if not self._job.is_running:  # else it does not end
                    self._require_own_folder()
                    self._files.forget()
                    self._record = None
                    self._set(FilmCaptureStatus())
        return self._status

    def subject_renamed(self, name: str, new_name: str) -> None:
        """Let the report of a subject's film bear its new name."""
        with self._job.lock:
            record = self._record
            if record is None or not self._has_made(name):
                return
            renamed = record.model_copy(update={"subject": new_name})
            try:
                self._files.write(renamed)
            except StorageError as error:
                log.warning("the film's report has the subject's old name: %s", error)
                return
            self._record = renamed
            self._set(replace(self._status, subject=new_name))

    def subject_removed(self, name: str) -> None:
        """Delete the report of a subject's film, and its pictures."""
        with self._job.lock:
            if self._has_made(name):
                self._files.forget()
                self._record = None
                self._set(FilmCaptureStatus())

    def close(self) -> None:
        """End the capture that runs, because the camera ends; it can be resumed at its next start."""
        self._closing.set()
        self._job.cancel()
        if not self._job.is_running:  # else its thread still writes
            self._files.release()

    def picture(self, name: str) -> bytes:
        """A JPEG file of the last report; see `FilmCaptureControl.picture`."""
        return self._files.picture(name)

    def _has_made(self, name: str) -> bool:
        """Whether the last capture is done, and made the subject of that name."""
        return (self._status.subject, self._status.stage) == (name, FilmStage.DONE)

    def _require_own_folder(self) -> None:
        """Take the folder.

        Raises:
            ConflictError: another process has it.
            StorageError: it cannot be created, or what it keeps cannot be read.
        """
        owned = self._files.take()
        if not owned:
            raise ConflictError(
                "another Relit Camera has the folder of films",
                "use that one's panel, or start this one with a data folder of its own (storage.data_dir)",
            )
        if self._record is None:
            self._look_at_what_is_kept()  # the other one may have left something

    def _look_at_what_is_kept(self) -> None:
        """Read the record, and delete what belongs to none: a film that was received when the camera was killed.

        Raises:
            StorageError: the record cannot be read; everything stays.
        """
        record = self._files.read()
        if record is not None and record.state is RecordedState.DONE:
            try:
                stored = self._scene_controller.subjects.names()
            except RelitError:
                stored = [record.subject]  # nobody knows
            if record.subject not in stored:
                record = None  # deleted by other means: nothing of a person is kept beyond that
        if record is None:
            self._files.forget()
            return
        if record.state is RecordedState.DONE:
            self._files.keep_result()
        else:
            self._files.keep_film(record)
        self._record, self._status = record, self._settled(record)

    def _begin(self, record: FilmRecord, canceled: threading.Event) -> None:
        progress = FilmProgress(self._clock)
        self._set(FilmCaptureStatus(FilmStage.READING, record.subject, record.file_name, progress.steps()))
        shown = self._maker.shown()
        self._job.begin(lambda: self._run(record, canceled, progress, shown), self._set)

    def _run(
        self, record: FilmRecord, canceled: threading.Event, progress: FilmProgress, before: Scene
    ) -> FilmCaptureStatus:
        """Work; `before` is what was shown when somebody asked for it. Returns how it ended."""

        def tell(stage: str, done: int, total: int | None) -> None:
            new_step = progress.note(stage, done, total)
            stage_now = FilmStage.BUILDING if progress.is_building else FilmStage.READING
            changed = replace(self._status, stage=stage_now, stages=progress.steps(), progress=progress.share())
            self._set(changed, seldom=not new_step)

        film = self._files.film(record)
        try:
            if film is None:
                raise StorageError("the film is not there any more", "send it again")
            report, not_shown = self._maker.make(
                record.subject,
                REPLACED,
                before,
                self._build,
                film,
                record.file_name,
                record.options,
                self._files.folder,
                timeout_s=self._limits.timeout_s,
                canceled=canceled,
                progress=tell,
                most_bytes=self._limits.most_bytes,
            )
            progress.finish()
            pictures = tuple(PICTURE_PATH.format(name) for name in report.pictures)
            report = replace(report, pictures=pictures)
            ended = self._settle(record, progress, RecordedState.DONE, report=report, what=not_shown)
            self._files.keep_result()
        except Exception as error:  # also a fault: else nobody would hear that it has ended
            if not canceled.is_set():
                what, cure = describe_failure("film capture", error, {str(film): f"'{record.file_name}'"})
                return self._settle(record, progress, RecordedState.FAILED, what=what, cure=cure)
            state = RecordedState.BEGUN if self._closing.is_set() else RecordedState.CANCELED
            return self._settle(record, progress, state)
        return ended

    def _settle(
        self, record: FilmRecord, progress: FilmProgress, state: RecordedState, **changes: object
    ) -> FilmCaptureStatus:
        """Keep how a capture ended; returns its status."""
        ended = record.model_copy(update={"state": state, **changes})
        try:
            self._files.write(ended)
        except StorageError as error:  # the subject is stored, or it is not: that does not depend on the record
            log.warning("how the film capture ended is not kept: %s", error)
        self._record = ended
        return replace(self._settled(ended), stages=progress.steps(), progress=progress.share())

    def _settled(self, record: FilmRecord) -> FilmCaptureStatus:
        """The status of a capture that does not run."""
        done = record.state is RecordedState.DONE
        return FilmCaptureStatus(
            stage=STAGE_BY_STATE[record.state],
            subject=record.subject,
            film=record.file_name,
            progress=1.0 if done else 0.0,
            what=record.what,
            cure=record.cure,
            can_resume=not done and self._files.film(record) is not None,
            report=record.report,
        )

    def _set(self, status: FilmCaptureStatus, seldom: bool = False) -> None:
        """Set the status and tell it; `seldom`: only if nothing was told for a while."""
        self._status = status
        self._told.publish(asdict(status), seldom)
