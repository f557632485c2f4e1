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

from relit_camera.app.captures.film.film_folder import FilmFolder, FilmRecord, RecordedState, film_suffix
from relit_camera.app.captures.film.film_progress import FilmProgress
from relit_camera.app.captures.subject_maker import SubjectMaker, require_replaceable
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import ConflictError, RelitError, StorageError
from relit_camera.base.storage.folder_redaction import redact_folders
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
        self._files, self._scene_controller, self._events = FilmFolder(folder), scene_controller, events
        self._build, self._limits, self._clock = build, limits, clock
        self._maker = SubjectMaker(scene_controller, events)
        self._lock = threading.RLock()
        self._canceled = threading.Event()
        self._thread: threading.Thread | None = None
        self._told_at = float("-inf")
        self._closing = threading.Event()
        self._record = self._files.read()
        if self._record is None:
            self._files.forget()  # a film that was received when the camera was killed
        self._status = self._settled(self._record) if self._record else FilmCaptureStatus()

    def status(self) -> FilmCaptureStatus:
        """How far the last capture is."""
        return self._status

    @contextmanager
    def receive(self, name: str, file_name: str, options: FilmOptions) -> Iterator[Path]:
        """Give a path to write a film to; see `FilmCaptureControl.receive`."""
        suffix = film_suffix(file_name)
        require_replaceable(self._scene_controller.subjects, name, REPLACED)
        with self._lock:
            self._require_idle()
            before, canceled = self._status, threading.Event()
            self._canceled = canceled
            self._set(FilmCaptureStatus(FilmStage.RECEIVING, name, file_name))
        try:
            with self._files.receiving(suffix) as path:
                yield path
                if canceled.is_set():
                    raise ConflictError("the capture was canceled", "send the film again")
            record = FilmRecord(subject=name, file_name=file_name, film=f"film{suffix}", options=options)
            self._files.write(record)
        except BaseException:
            self._set(before)
            raise
        self._begin(record, canceled)

    def resume(self, options: FilmOptions | None = None) -> FilmCaptureStatus:
        """Go on with the film that is there; see `FilmCaptureControl.resume`."""
        with self._lock:
            self._require_idle()
            if self._record is None or not self._status.can_resume:
                raise ConflictError("there is no film to go on with", "send one")
            require_replaceable(self._scene_controller.subjects, self._record.subject, REPLACED)
            changes = {"state": RecordedState.BEGUN, "what": "", "cure": "", "options": options or self._record.options}
            record = self._record.model_copy(update=changes)
            self._files.write(record)
            self._canceled = threading.Event()
            self._begin(record, self._canceled)
            return self._status

    def cancel(self, forget: bool = False) -> FilmCaptureStatus:
        """End the capture that runs, if one does; see `FilmCaptureControl.cancel`."""
        self._end()
        with self._lock:
            if forget and not self._status.stage.is_running:  # else it is being received, or does not end
                self._files.forget()
                self._record = None
                self._set(FilmCaptureStatus())
            return self._status

    def close(self) -> None:
        """End the capture that runs, because the camera ends; it can be resumed at its next start."""
        self._closing.set()
        self._end()

    def picture(self, name: str) -> bytes:
        """A JPEG file of the last report; see `FilmCaptureControl.picture`."""
        return self._files.picture(name)

    def _end(self) -> None:
        with self._lock:
            thread = self._thread
            self._canceled.set()
        if thread is not None:
            thread.join(3.0)

    def _require_idle(self) -> None:
        if self._status.stage.is_running:
            raise ConflictError("a capture from a film runs already", "wait for its end, or cancel it")

    def _begin(self, record: FilmRecord, canceled: threading.Event) -> None:
        with self._lock:
            self._record = record
            progress = FilmProgress(self._clock)
            self._set(FilmCaptureStatus(FilmStage.READING, record.subject, record.file_name, progress.steps()))
            arguments = record, canceled, progress, self._maker.shown()
            self._thread = threading.Thread(target=self._run, args=arguments, name="film-capture", daemon=True)
            self._thread.start()

    def _run(self, record: FilmRecord, canceled: threading.Event, progress: FilmProgress, before: Scene) -> None:
        """Work; `before` is what was shown when somebody asked for it."""

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
            self._settle(record, progress, RecordedState.DONE, report=report, what=not_shown)
            self._files.keep_result()
        except RelitError as error:
            if not canceled.is_set():
                log.warning("film capture: %s", error)
                what = redact_folders(error.what.replace(str(film), f"'{record.file_name}'"))
                self._settle(record, progress, RecordedState.FAILED, what=what, cure=redact_folders(error.cure))
            elif self._closing.is_set():
                self._settle(record, progress, RecordedState.BEGUN)
            else:
                self._settle(record, progress, RecordedState.CANCELED)
        except Exception as error:  # else nobody would hear that it has ended
            log.exception("the film capture failed")
            what = redact_folders(f"it failed in a way that nobody expected ({type(error).__name__}: {error})")
            self._settle(record, progress, RecordedState.FAILED, what=what, cure="please report it")

    def _settle(self, record: FilmRecord, progress: FilmProgress, state: RecordedState, **changes: object) -> None:
        """Keep how a capture ended, and tell it."""
        ended = record.model_copy(update={"state": state, **changes})
        try:
            self._files.write(ended)
        except StorageError as error:  # the subject is stored, or it is not: that does not depend on the record
            log.warning("how the film capture ended is not kept: %s", error)
        with self._lock:
            self._record = ended
            self._set(replace(self._settled(ended), stages=progress.steps(), progress=progress.share()))

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
        now = self._clock.now()
        if not seldom or now >= self._told_at + self._limits.event_interval_s:
            self._told_at = now
            self._events.publish("film-capture", **asdict(status))
