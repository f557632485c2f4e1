"""The picture path in threads of its own: what hangs in it can be left behind, and what fails is tried again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait

from relit_camera.base.errors import PipelineHangError, RelitError
from relit_camera.base.images.image_types import Frame
from relit_camera.base.newest_slot import NewestSlot
from relit_camera.live.pipeline import Pipeline, RenderedFrame, RenderTask
from relit_camera.live.scene.scene import Scene

RETRY_S = 1.0
"""Pause after a frame that could not be processed; it doubles with each one in a row."""
MAX_BACKOFF_DOUBLINGS = 4
HANG_TIMEOUT_S = 2.0
"""A frame that takes longer hangs: something else is shown meanwhile."""
ABANDON_TIMEOUT_S = 10.0
"""One that takes so long is left behind, and another line begun. Twice as long with each in a row, as the pauses."""
FIRST_FRAME_FACTOR = 6
"""A line's first frame may take so many times as long: models are opened for it."""
MAX_ABANDONED_WORKERS = 3
"""Lines that hang hold memory: with so many, no other is begun before one of them ends."""
FAULTS_BEFORE_RESTART = 3
"""After so many faults of ours in a row the state of the line itself is suspected: it is begun anew."""

_POLL_S = 0.2


class PipelineWorker:
    """One pipeline at work. Frames are handed over by `submit_frame`; pictures and errors come from its threads.

    One frame is finished while the next is begun, no more.
    """

    def __init__(
        self,
        make: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        on_done: Callable[[Frame, RenderedFrame], None],
        on_error: Callable[[Exception], None],
    ) -> None:
        """Begin; `make` is called in the line's own thread, for it may open models."""
        self.pipeline: Pipeline | None = None
        self._make, self._scene, self._on_done, self._on_error = make, scene, on_done, on_error
        self.pictures = 0
        self._frames: NewestSlot[Frame] = NewestSlot()
        self._newest = self._frames.reader()
        self._closing = threading.Event()
        self._began_at: float | None = None
        self._finisher = ThreadPoolExecutor(1, "finisher")
        self._finishing: Future[None] = Future()
        self._finishing.set_result(None)
        # A daemon thread: what hangs must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, name="line", daemon=True)
        self._thread.start()

    def submit_frame(self, frame: Frame) -> None:
        """Hand a frame over. It is taken when the one before has been begun, unless a newer one has come by then."""
        self._frames.put(frame)

    @property
    def busy_s(self) -> float:
        """Seconds since the frame in hand was taken; 0 while there is none."""
        began_at = self._began_at
        return 0.0 if began_at is None else time.monotonic() - began_at

    @property
    def dropped(self) -> int:
        """Frames that were replaced by newer ones before they were taken."""
        return self._newest.dropped

    @property
    def stages(self) -> str:
        """The stages that it is in, for people."""
        return ", ".join(self.pipeline.timer.running()) if self.pipeline else "opening models"

    def close(self) -> None:
        """Let it end when it can. Nothing comes from it any more; a frame that hangs is left to itself."""
        self._closing.set()
        self._frames.close()

    def ended(self, timeout_s: float = 0.0) -> bool:
        """Whether its threads have ended, waiting up to `timeout_s` for it. Only after `close`."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while not self._closing.is_set():
            frame = self._newest.get(_POLL_S)
            if frame is not None:
                self._began_at = time.monotonic()
                try:
                    self._work(frame)
                finally:
                    self._began_at = None
        self._finisher.shutdown()

    def _work(self, frame: Frame) -> None:
        try:
            if self.pipeline is None:
                self.pipeline = self._make()
            finish = self.pipeline.begin(frame, self._scene)
        except Exception as error:  # nothing that one frame does may end the camera
            self._failed(error)
            return
        wait([self._finishing])
        if not self._closing.is_set():
            self._finishing = self._finisher.submit(self._finish, frame, finish)

    def _finish(self, frame: Frame, finish: RenderTask) -> None:
        try:
            finished = finish()
            if not self._closing.is_set():
                self.pictures += 1
                self._on_done(frame, finished)
        except Exception as error:
            self._failed(error)

    def _failed(self, error: Exception) -> None:
        if not self._closing.is_set():
            self._on_error(error)


class PipelineSupervisor:
    """Keeps a line at work. Used by one thread; told of pictures and errors by the line's.

    After an error the line gets no frames for a while, or until the scene is another. One that hangs is closed, left
    behind, and another begun, with a new pipeline; so is one in which faults of ours come one after the other.
    """

    def __init__(
        self,
        first: Pipeline,
        make: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        on_done: Callable[[Frame, RenderedFrame], None],
        on_trouble: Callable[[Exception | None], None],
    ) -> None:
        """Set up; the first frame begins.

        Args:
            first: the pipeline to begin with.
            make: makes another.
            scene: the scene that counts now.
            on_done: gets each frame and its picture, in the line's thread.
            on_trouble: gets each error, and None when a picture came after one.
        """
        self.pipeline = first
        """The one at work."""
        self._next: Callable[[], Pipeline] = lambda: first
        self._make, self._scene, self._on_done, self._on_trouble = make, scene, on_done, on_trouble
        self._worker: PipelineWorker | None = None
        self._abandoned: list[PipelineWorker] = []
        self._dropped_before = 0
        self._error_count = self._hang_count = 0
        self._hang_reported = self._restart_due = False
        self._retry_at = 0.0
        self._failed_scene: Scene | None = None

    @property
    def dropped(self) -> int:
        """Frames that no line took."""
        return self._dropped_before + (self._worker.dropped if self._worker else 0)

    def submit_frame(self, frame: Frame) -> bool:
        """Hand a frame to the line. Returns whether its picture can be expected: if not, something must stand in."""
        self._abandoned = [worker for worker in self._abandoned if not worker.ended()]
        worker = self._worker or self._restarted()
        if worker is None:
            return False
        self.pipeline = worker.pipeline or self.pipeline
        if worker.busy_s > HANG_TIMEOUT_S:
            self._handle_hang(worker)
            return False
        if self._error_count and time.monotonic() < self._retry_at and self._scene() is self._failed_scene:
            return False
        if self._restart_due:
            self._restart_due = False
            self._abandon(worker)
            return False
        worker.submit_frame(frame)
        return not (self._error_count or self._hang_reported)

    def close(self) -> None:
        """Let all lines end; see `ended`."""
        for worker in self._workers():
            worker.close()

    def ended(self, by: float) -> bool:
        """Whether all have ended, waiting until the monotonic time `by` for it. Only after `close`."""
        return all(worker.ended(max(0.0, by - time.monotonic())) for worker in self._workers())

    def _workers(self) -> list[PipelineWorker]:
        return [*self._abandoned, *([self._worker] if self._worker else [])]

    def _done(self, frame: Frame, finished: RenderedFrame) -> None:
        if self._error_count or self._hang_reported:
            self._error_count = self._hang_count = 0
            self._hang_reported = self._restart_due = False
            self._on_trouble(None)
        self._on_done(frame, finished)

    def _failed(self, error: Exception) -> None:
        self._retry_at = time.monotonic() + RETRY_S * 2 ** min(self._error_count, MAX_BACKOFF_DOUBLINGS)
        self._failed_scene = self._scene()
        self._error_count += 1
        self._restart_due = not isinstance(error, RelitError) and self._error_count % FAULTS_BEFORE_RESTART == 0
        self._on_trouble(error)

    def _handle_hang(self, worker: PipelineWorker) -> None:
        starts = worker.pictures == 0
        if not self._hang_reported and (not starts or worker.busy_s > ABANDON_TIMEOUT_S):
            self._hang_reported = True
            self._on_trouble(
                PipelineHangError(
                    f"it has given no picture for some seconds (in: {worker.stages})",
                    "a still stands in, and it is begun anew by itself; if that does not help, restart the camera",
                )
            )
        if worker.busy_s > ABANDON_TIMEOUT_S * 2 ** min(self._hang_count, MAX_BACKOFF_DOUBLINGS) * (
            FIRST_FRAME_FACTOR if starts else 1
        ):
            self._hang_count += 1
            self._abandon(worker)

    def _abandon(self, worker: PipelineWorker) -> None:
        worker.close()
        self._abandoned.append(worker)
        self._dropped_before += worker.dropped
        self._worker = None

    def _restarted(self) -> PipelineWorker | None:
        if len(self._abandoned) < MAX_ABANDONED_WORKERS:
            self._worker = PipelineWorker(self._next, self._scene, self._done, self._failed)
            self._next = self._make
        return self._worker
