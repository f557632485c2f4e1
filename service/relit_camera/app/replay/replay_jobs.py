"""Videos that are sent to the running camera and relit as its scene says, one at a time, by a worker process."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from urllib.parse import quote

from relit_camera.app.background_job import BackgroundJob, StatusEvents, describe_failure
from relit_camera.app.captures.film.film_folder import film_suffix
from relit_camera.app.replay.replay_worker import ReplayOutcome, ReplayWork
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.worker_process import Progress, run_in_worker_process
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ConflictError, WorkerError
from relit_camera.base.storage.atomic_files import atomic_path, make_folder, remove_unfinished_files
from relit_camera.base.storage.folder_lock import FolderLock
from relit_camera.base.storage.named_files import NamedFiles
from relit_camera.base.storage.upload import Upload
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.replay_status import ReplayStage, ReplayStatus

ReplayWriter = Callable[[ReplayWork, Path, Progress], ReplayOutcome]
"""Relights a video into a file. It must be a function of a module, since another process imports it."""

SUFFIX = ".mp4"
SENT = ".sent"
"""The folder of the video that was sent, within that of the results; it is deleted when its work ends."""
NOBODY, NOBODY_CURE = "nobody is shown who could be relit", "choose or capture a subject first"
VIDEO_PATH = "/api/v1/replays/{}/video"


@dataclass(frozen=True)
class ReplayLimits:
    """Limits of the work.

    Attributes:
        timeout_s: after which the worker is ended.
        most_bytes: memory that it may take.
        event_interval_s: least time between two events of the progress.
    """

    timeout_s: float = 6 * 3600.0
    most_bytes: int = 6 << 30
    event_interval_s: float = 0.5


class ReplayJobs:
    """Implements `live.camera_control.ReplayControl`. One replay at a time, in a thread of its own."""

    def __init__(
        self,
        folder: Path,
        settings: Callable[[], RelitSettings],
        scene_controller: SceneController,
        events: EventHub,
        write: ReplayWriter,
        limits: ReplayLimits = ReplayLimits(),
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up; a video that an earlier run of the camera has not finished is deleted.

        Args:
            folder: of the results.
            settings: gives those of the camera at present: its tracker may be changed while it runs.
            scene_controller: its scene says how the videos are relit.
            events: hears `replay` whenever the status of one changes.
            write: relights a video.
            limits: of the work.
            clock: by which events are limited.
        """
        self._settings, self._scene_controller = settings, scene_controller
        self._write, self._limits = write, limits
        self._results = NamedFiles(folder, "replay", [SUFFIX])
        self._folder_lock = FolderLock(folder)
        self._told = StatusEvents(events, "replay", limits.event_interval_s, clock)
        self._job = BackgroundJob("replay", "a video is being relit already", "wait for its end, or delete it")
        self._last: ReplayStatus | None = None
        if folder.is_dir() and self._folder_lock.take():
            self._remove_sent()

    def all(self) -> list[ReplayStatus]:
        """Those that are stored, and the last one; see `ReplayControl.all`."""
        last = self._last
        found = {name: _done(name) for name in self._results.names()} | ({last.name: last} if last else {})
        return [found[name] for name in sorted(found)]

    def status(self, name: str) -> ReplayStatus:
        """How far one is; see `ReplayControl.status`."""
        last = self._last
        if last is not None and last.name == name:
            return last
        self._results.path(name)
        return _done(name)

    @contextmanager
    def receive(self, name: str, file_name: str) -> Iterator[Upload]:
        """Give a path to write a video to; see `ReplayControl.receive`."""
        suffix = film_suffix(file_name)
        self._results.require_free_name(name)
        with self._job.taken() as canceled:
            if name in self._results.names():
                raise ConflictError(f"there is a replay '{name}' already", "choose another name, or delete that one")
            if self._scene_controller.scene.shows_nobody:
                raise ConflictError(NOBODY, NOBODY_CURE)
            self._require_own_folder()
            before, sent = self._last, self._results.folder / SENT
            try:
                self._set(ReplayStatus(name, ReplayStage.RECEIVING))
                make_folder(sent, private=True)
                with atomic_path(sent / f"video{suffix}") as path:
                    upload = Upload(path, canceled, "the replay was canceled", "send the video again")
                    yield upload
                    upload.require_wanted()
                self._begin(name, sent / f"video{suffix}", file_name, canceled)
            except BaseException:
                self._remove_sent()
                self._give_up(name, before)
                raise

    def video(self, name: str) -> Path:
        """The file of a relit video; see `ReplayControl.video`."""
        last = self.status(name)
        if last.stage.is_running:
            raise ConflictError(f"the replay '{name}' has no video yet", "wait for its end; GET replays/NAME tells it")
        if last.stage is not ReplayStage.DONE:
            raise ConflictError(f"the replay '{name}' has no video: it has {last.stage}", "send the video again")
        return self._results.path(name)

    def remove(self, name: str) -> None:
        """End a replay that runs, or delete its video; see `ReplayControl.remove`."""
        last = self.status(name)
        if last.stage.is_running:
            self._job.cancel(only=lambda: self._runs(name))
        with self._job.lock:
            if self._last is not None and self._last.name == name and not self._last.stage.is_running:
                self._last = None
        if name in self._results.names():
            self._results.remove(name)

    def _runs(self, name: str) -> bool:
        """Whether the last replay has that name, and runs."""
        return self._last is not None and self._last.name == name and self._last.stage.is_running

    def close(self) -> None:
        """End the replay that runs, if one does."""
        self._job.cancel()
        if not self._job.is_running:  # else its thread still writes
            self._folder_lock.release()

    def _require_own_folder(self) -> None:
        """Create the folder where it is missing, and take it.

        Raises:
            ConflictError: another process has it.
            StorageError: it cannot be created.
        """
        make_folder(self._results.folder, private=True)
        if not self._folder_lock.take():
            raise ConflictError(
                "another Relit Camera has the folder of replays",
                "use that one's panel, or start this one with a data folder of its own (storage.data_dir)",
            )

    def _give_up(self, name: str, before: ReplayStatus | None) -> None:
        """Tell that an upload has ended, and be as before it."""
        self._set(ReplayStatus(name, ReplayStage.CANCELED))
        self._last = before

    def _begin(self, name: str, video: Path, file_name: str, canceled: threading.Event) -> None:
        scene = self._scene_controller.scene
        stored = scene.subject_name in self._scene_controller.subjects.names()
        subject = scene.subject_name if stored else scene.subject
        if scene.shows_nobody:  # somebody has chosen nobody meanwhile
            self._remove_sent()
            self._set(ReplayStatus(name, ReplayStage.FAILED, what=NOBODY, cure=NOBODY_CURE))
            return
        lighting = scene.look.lighting.model_copy(update={"split": 0.0})
        look = scene.look.model_copy(update={"lighting": lighting})
        work = ReplayWork(self._settings(), replace(scene, subject=None, look=look, frozen=False), subject, video)
        self._set(ReplayStatus(name, ReplayStage.WORKING))
        self._job.begin(lambda: self._run(name, work, file_name, canceled), self._set)

    def _run(self, name: str, work: ReplayWork, file_name: str, canceled: threading.Event) -> ReplayStatus:
        """Relight it; returns how it ended."""

        def tell(stage: str, done: int, total: int | None) -> None:
            share = min(done / total, 1.0) if total else 0.0
            self._set(ReplayStatus(name, ReplayStage.WORKING, round(share, 4), done), seldom=True)

        limits = self._limits
        try:
            with self._results.replacing(name, SUFFIX) as path:
                outcome = run_in_worker_process(
                    self._write,
                    work,
                    path,
                    timeout_s=limits.timeout_s,
                    canceled=canceled,
                    progress=tell,
                    most_bytes=limits.most_bytes,
                )
                if canceled.is_set():
                    raise WorkerError("the replay was canceled", "send the video again")
            ended = replace(_done(name), frames=outcome.frames, what="; ".join(_notes(outcome)))
        except Exception as error:  # also a fault: else nobody would hear that it has ended
            if canceled.is_set():
                ended = ReplayStatus(name, ReplayStage.CANCELED)
            else:
                what, cure = describe_failure("replay", error, {str(work.video): f"'{file_name}'"})
                ended = ReplayStatus(name, ReplayStage.FAILED, what=what, cure=cure)
        self._remove_sent()
        if ended.stage is not ReplayStage.DONE:
            remove_unfinished_files(self._results.folder)  # of a worker that was killed
        return ended

    def _remove_sent(self) -> None:
        with suppress(OSError):
            shutil.rmtree(self._results.folder / SENT)

    def _set(self, status: ReplayStatus, seldom: bool = False) -> None:
        """Set the status of the last one and tell it; `seldom`: only if nothing was told for a while."""
        self._last = status
        self._told.publish(asdict(status), seldom)


def _done(name: str) -> ReplayStatus:
    return ReplayStatus(name, ReplayStage.DONE, 1.0, video=VIDEO_PATH.format(quote(name)))


def _notes(outcome: ReplayOutcome) -> list[str]:
    without = outcome.frames - outcome.with_face
    told = [f"no face was found in {without} of {outcome.frames} frames"] if without else []
    return [*told, *outcome.notes]
