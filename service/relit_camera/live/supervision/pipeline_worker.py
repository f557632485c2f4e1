"""One pipeline at work in threads of its own: when it hangs, it can be abandoned and another started."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait

from relit_camera.base.concurrency.clock import Clock
from relit_camera.base.concurrency.newest_slot import NewestSlot
from relit_camera.base.concurrency.run_delay import run_delay_s
from relit_camera.base.images.image_types import Frame
from relit_camera.live.pipeline import Pipeline, RenderedFrame, RenderTask
from relit_camera.live.scene.scene import Scene
from relit_camera.live.supervision.pipeline_health import (
    Event,
    FrameFailed,
    FrameFinished,
    FrameStarted,
    ModelsOpening,
    PictureRendered,
    WorkerEnded,
)

_POLL_S = 0.2


class PipelineWorker:
    """Renders the frames that `submit_frame` hands over, the newest first. It posts an event at each step.

    While one frame is rendered the next is begun, no more. The events `FrameStarted`, `ModelsOpening`,
    `FrameFinished`, `PictureRendered` and `FrameFailed` come from its threads, and `WorkerEnded` is the last one. After
    `close` it posts no other event and gives no picture.

    Attributes:
        pipeline: the one at work; None until it is made.
    """

    def __init__(
        self,
        number: int,
        make_pipeline: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        post: Callable[[Event], None],
        on_picture: Callable[[PictureRendered, Frame, RenderedFrame], None],
        clock: Clock,
    ) -> None:
        """Start the threads.

        Args:
            number: of this worker, for its events.
            make_pipeline: called in the worker's own thread with the first frame, for it may open models.
            scene: gives the present scene.
            post: takes an event.
            on_picture: takes the event that a picture was rendered, its frame and the picture.
            clock: what the events' times are of.
        """
        self.pipeline: Pipeline | None = None
        self._number, self._clock = number, clock
        self._make_pipeline, self._scene, self._post, self._on_picture = make_pipeline, scene, post, on_picture
        self._frames: NewestSlot[Frame] = NewestSlot()
        self._newest = self._frames.reader()
        self._closing = threading.Event()
        self._renderer = ThreadPoolExecutor(1, "renderer")
        self._renderer_id: int | None = None
        self._rendering: Future[None] = Future()
        self._rendering.set_result(None)
        # A daemon thread: when it hangs, it must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, name="pipeline", daemon=True)
        self._thread.start()

    def submit_frame(self, frame: Frame) -> None:
        """Hand a frame over. It is taken once the one before it was begun, unless a newer one has come by then."""
        self._frames.put(frame)

    @property
    def dropped(self) -> int:
        """Frames that were replaced by newer ones before they were taken."""
        return self._newest.dropped

    @property
    def stages(self) -> str:
        """The stages that are running now, for messages to users."""
        return ", ".join(self.pipeline.timer.running()) if self.pipeline else "opening models"

    @property
    def run_delay_s(self) -> float:
        """For how long its threads have waited for a processor since they began."""
        return sum(run_delay_s(thread) for thread in (self._thread.native_id, self._renderer_id) if thread is not None)

    def close(self) -> None:
        """Let the threads end when they can. A frame that hangs is not waited for."""
        self._closing.set()
        self._frames.close()

    def ended(self, timeout_s: float = 0.0) -> bool:
        """Whether the threads have ended, waiting up to `timeout_s` for it. Call after `close`."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                frame = self._newest.get(_POLL_S)
                if frame is not None:
                    begun_at = self._clock.now()
                    self._post_unless_closed(FrameStarted(self._number, begun_at))
                    self._begin(frame, begun_at)
                    self._post_unless_closed(FrameFinished(self._number))
            self._renderer.shutdown()
            if self.pipeline is not None:
                self.pipeline.close()
        finally:
            self._post(WorkerEnded(self._number))  # else a worker that is given up would count as hanging for ever

    def _begin(self, frame: Frame, begun_at: float) -> None:
        try:
            if self.pipeline is None:
                self.pipeline = self._make_pipeline()
                self.pipeline.on_opening = self._note_opening
            task = self.pipeline.begin(frame, self._scene)
        except Exception as error:  # nothing that one frame does may end the camera
            self._fail(error, begun_at)
            return
        wait([self._rendering])
        if not self._closing.is_set():
            self._rendering = self._renderer.submit(self._render, frame, task, begun_at)

    def _render(self, frame: Frame, task: RenderTask, begun_at: float) -> None:
        self._renderer_id = threading.get_native_id()
        try:
            rendered = task()
            if not self._closing.is_set():
                self._on_picture(PictureRendered(self._number, self._clock.now(), begun_at), frame, rendered)
        except Exception as error:
            self._fail(error, begun_at)

    def _note_opening(self) -> None:
        self._post_unless_closed(ModelsOpening(self._number, self._clock.now()))

    def _fail(self, error: Exception, begun_at: float) -> None:
        revision = self._scene().revision
        self._post_unless_closed(FrameFailed(self._number, self._clock.now(), begun_at, revision, error))

    def _post_unless_closed(self, event: Event) -> None:
        if not self._closing.is_set():
            self._post(event)
