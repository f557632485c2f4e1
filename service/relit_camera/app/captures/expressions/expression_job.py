"""Expression stills for a stored subject while the camera runs: from its webcam, or from a video that is sent."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from relit_camera.app.background_job import BackgroundJob, StatusEvents, describe_failure
from relit_camera.app.captures.expressions.guided_filming import FilmedStills, FilmingState, GuidedFilming
from relit_camera.app.captures.film.film_folder import film_suffix
from relit_camera.app.captures.subject_maker import SubjectMaker
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import ConflictError
from relit_camera.base.storage.atomic_files import atomic_path, make_folder
from relit_camera.base.storage.folder_lock import FolderLock
from relit_camera.base.storage.upload import Upload
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.expression_status import ExpressionCaptureStatus, ExpressionReport, ExpressionStage

log = logging.getLogger(__name__)

FilmedBuilder = Callable[[FilmedStills, Path, Path], ExpressionReport]
"""Makes stills of the webcam's frames for a subject's file, and writes another file with them. It must be a function of
a module, since another process imports it."""
VideoBuilder = Callable[[Path, Path, Path, Progress], ExpressionReport]
"""The same of a video's file."""
SHARES = {"Following the face": (0.0, 0.85), "Estimating the light of the room": (0.85, 0.15)}
"""Stage of the work on a video → where its share of the time begins, and how large it is, roughly."""


@dataclass(frozen=True)
class ExpressionLimits:
    """Limits of the work.

    Attributes:
        filmed_timeout_s: after which the worker is ended that has the webcam's frames.
        video_timeout_s: the same of a video: two minutes of it are looked at.
        most_bytes: memory that the worker may take.
        event_interval_s: least time between two events that tell nothing but the progress.
    """

    filmed_timeout_s: float = 300.0
    video_timeout_s: float = 900.0
    most_bytes: int = 4 << 30
    event_interval_s: float = 0.5


class ExpressionJob:
    """Implements `live.camera_control.ExpressionCaptureControl`. One capture at a time, in a thread of its own."""

    def __init__(
        self,
        folder: Path,
        filming: GuidedFilming,
        scene_controller: SceneController,
        events: EventHub,
        build: FilmedBuilder,
        build_of_video: VideoBuilder,
        limits: ExpressionLimits = ExpressionLimits(),
        clock: Clock = SYSTEM_CLOCK,
        webcam: threading.Lock | None = None,
    ) -> None:
        """Set up; a video that an earlier run of the camera has left is deleted.

        Args:
            folder: of the video while it is worked on.
            filming: films the person before the webcam.
            scene_controller: stores the subject and shows it.
            events: hears `expression-capture` whenever the status changes.
            build: makes stills of the webcam's frames.
            build_of_video: makes stills of a video.
            limits: of the work.
            clock: by which events are limited.
            webcam: is held while this runs, by one capture of those that need its frames.
        """
        self._folder, self._filming, self._scene_controller = folder, filming, scene_controller
        self._build, self._build_of_video, self._limits = build, build_of_video, limits
        self._maker = SubjectMaker(scene_controller, events)
        self._told = StatusEvents(events, "expression-capture", limits.event_interval_s, clock)
        self._job = BackgroundJob("expression-capture", "expression stills are being taken already", shared=webcam)
        self._folder_lock = FolderLock(folder)
        self._status = ExpressionCaptureStatus()
        if folder.is_dir() and self._folder_lock.take():
            self._remove_video()

    def status(self) -> ExpressionCaptureStatus:
        """How far the last capture is."""
        return self._status

    def start(self, subject: str | None = None) -> ExpressionCaptureStatus:
        """Begin to film the person before the webcam; see `ExpressionCaptureControl.start`."""
        name = self._stored(subject)
        with self._job.taken() as canceled:
            self._set(ExpressionCaptureStatus(ExpressionStage.FILMING, name, items=_items()))
            self._job.begin(lambda: self._run(lambda: self._film(name, canceled), canceled), self._set)
            return self._status

    @contextmanager
    def receive(self, subject: str | None, file_name: str) -> Iterator[Upload]:
        """Give a path to write a video to; see `ExpressionCaptureControl.receive`."""
        suffix = film_suffix(file_name)
        name = self._stored(subject)
        with self._job.taken() as canceled:
            self._require_own_folder()
            before, video = self._status, self._folder / f"video{suffix}"
            try:
                self._set(ExpressionCaptureStatus(ExpressionStage.RECEIVING, name, file_name, items=_items()))
                with atomic_path(video) as path:
                    upload = Upload(path, canceled, "the capture was canceled", "send the video again")
                    yield upload
                    upload.require_wanted()
                self._set(replace(self._status, stage=ExpressionStage.BUILDING))
                named = dict.fromkeys((str(video), video.name), f"'{file_name}'")
                self._job.begin(
                    lambda: self._run(lambda: self._read(name, video, canceled), canceled, named), self._set
                )
            except BaseException:
                self._remove_video()
                self._set(before)
                raise

    def cancel(self) -> ExpressionCaptureStatus:
        """End the capture that runs, if one does; the subject is as before then."""
        self._job.cancel()
        return self._status

    def close(self) -> None:
        """End the capture that runs, because the camera ends."""
        self._job.cancel()
        if not self._job.is_running:  # else its thread still reads
            self._folder_lock.release()

    def _stored(self, subject: str | None) -> str:
        """The name of the stored subject that gets stills: the one that is shown, if none is named.

        Raises:
            NotFoundError: there is none of that name.
            ConflictError: nobody is shown, or the subject is not stored.
        """
        name = subject or self._scene_controller.scene.subject_name
        if name is None:
            raise ConflictError("nobody is shown who could get expression stills", "choose or capture a face first")
        subjects = self._scene_controller.subjects
        if name not in subjects.names() and name in self._scene_controller.subject_files():
            raise ConflictError(
                f"the file of subject '{name}' was named on the command line, and is not stored",
                "store it in the panel, or use `relit capture expressions`",
            )
        subjects.path(name)
        return name

    def _run(
        self,
        work: Callable[[], tuple[ExpressionReport, str]],
        canceled: threading.Event,
        named: dict[str, str] | None = None,
    ) -> ExpressionCaptureStatus:
        """Work; returns how it ended."""
        try:
            report, not_shown = work()
            changes: dict[str, object] = {"stage": ExpressionStage.DONE, "report": report, "what": not_shown}
            changes |= {"progress": 1.0, "covered": report.covered}
        except Exception as error:  # also a fault: else nobody would hear that it has ended
            if canceled.is_set():
                changes = {"stage": ExpressionStage.CANCELED}
            else:
                what, cure = describe_failure("expression capture", error, named)
                changes = {"stage": ExpressionStage.FAILED, "what": what, "cure": cure}
        return replace(self._status, **{"prompt": "", "say": "", "face": False, **changes})  # type: ignore[arg-type]

    def _film(self, name: str, canceled: threading.Event) -> tuple[ExpressionReport, str]:
        """Film, and make stills of the frames; returns the report, and why the subject cannot be shown.

        Raises:
            RelitError: no stills can be made of what the webcam shows.
        """

        def tell(state: FilmingState) -> None:
            before, now = self._status, replace(self._status, **vars(state))
            if now != before:
                self._set(now, seldom=replace(now, progress=before.progress) == before)

        filmed = self._filming.film(canceled, tell)
        self._set(replace(self._status, stage=ExpressionStage.BUILDING, prompt="", say="", face=False))
        return self._maker.change(
            name,
            self._build,
            filmed,
            timeout_s=self._limits.filmed_timeout_s,
            canceled=canceled,
            most_bytes=self._limits.most_bytes,
        )

    def _read(self, name: str, video: Path, canceled: threading.Event) -> tuple[ExpressionReport, str]:
        """Make stills of a video; as `_film`."""

        def tell(stage: str, done: int, total: int | None) -> None:
            begins, share = SHARES.get(stage, (0.0, 0.0))
            progress = begins + share * (min(done / total, 1.0) if total else 0.0)
            self._set(replace(self._status, progress=round(progress, 3)), seldom=True)

        try:
            return self._maker.change(
                name,
                self._build_of_video,
                video,
                timeout_s=self._limits.video_timeout_s,
                canceled=canceled,
                progress=tell,
                most_bytes=self._limits.most_bytes,
            )
        finally:
            self._remove_video()  # only here, where the folder is this process's own

    def _require_own_folder(self) -> None:
        """Create the folder where it is missing, and take it.

        Raises:
            ConflictError: another process has it.
            StorageError: it cannot be created.
        """
        make_folder(self._folder, private=True)
        if not self._folder_lock.take():
            raise ConflictError(
                "another Relit Camera has the folder of videos for expression stills",
                "use that one's panel, or start this one with a data folder of its own (storage.data_dir)",
            )

    def _remove_video(self) -> None:
        """Delete the video that was sent, and the like that a killed camera has left."""
        with suppress(OSError):
            for path in self._folder.iterdir():
                path.unlink()

    def _set(self, status: ExpressionCaptureStatus, seldom: bool = False) -> None:
        """Set the status and tell it; `seldom`: only if nothing was told for a while."""
        before, self._status = self._status, status
        if status.stage is not before.stage:
            log.info("expression stills: %s %s", status.stage, status.what)
        self._told.publish(asdict(status), seldom)


def _items() -> tuple[str, ...]:
    from relit_camera.capture.expressions.live_prompts import PROMPTS

    return tuple(PROMPTS)
