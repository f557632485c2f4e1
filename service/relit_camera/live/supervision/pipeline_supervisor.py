"""Keeps a pipeline at work: starts workers, notices failures and hangs, and replaces a worker that does not recover."""

from __future__ import annotations

import queue
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import PipelineHangError
from relit_camera.base.images.image_types import Frame
from relit_camera.live.pipeline import Pipeline, RenderedFrame
from relit_camera.live.scene.scene import Scene
from relit_camera.live.supervision.adaptive_quality import QualityLimits, QualityState, next_quality
from relit_camera.live.supervision.pipeline_health import (
    Action,
    Event,
    FrameArrived,
    HealthLimits,
    PictureRendered,
    PipelineHealth,
    ReplacementAsked,
    ReportFailure,
    ReportHang,
    ReportRecovery,
    RetireWorker,
    ShowFallback,
    StartWorker,
    SubmitFrame,
    WorkerEnded,
    next_health,
)
from relit_camera.live.supervision.pipeline_worker import PipelineWorker

DEFAULT_LIMITS = HealthLimits()
DEFAULT_QUALITY_LIMITS = QualityLimits()
LATE_S = 1.0
"""The supervisor looks five times a second or more. Where it comes later than this, the rest of the time counts as one
in which the whole program did not run."""


class Worker(Protocol):
    """What the supervisor needs of a worker; see `PipelineWorker`."""

    pipeline: Pipeline | None
    """The one at work; None until it is made."""

    @property
    def dropped(self) -> int:
        """Frames that were replaced by newer ones before they were taken."""
        ...

    @property
    def stages(self) -> str:
        """The stages that are running now, for messages to users."""
        ...

    @property
    def run_delay_s(self) -> float:
        """For how long its threads have waited for a processor since they began."""
        ...

    def submit_frame(self, frame: Frame) -> None:
        """Hand a frame over."""
        ...

    def close(self) -> None:
        """Let the worker end when it can."""
        ...

    def ended(self, timeout_s: float = 0.0) -> bool:
        """Whether it has ended, waiting up to `timeout_s` for it."""
        ...


class WorkerFactory(Protocol):
    """Starts a worker; the arguments are those of `PipelineWorker`."""

    def __call__(
        self,
        number: int,
        make_pipeline: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        post: Callable[[Event], None],
        on_picture: Callable[[PictureRendered, Frame, RenderedFrame], None],
        clock: Clock,
    ) -> Worker:
        """Start the worker of that number."""
        ...


@dataclass(frozen=True)
class ShownPicture:
    """A picture that was handed on to be published.

    Attributes:
        frame: the live frame.
        rendered: its picture.
        at: when it was rendered, in seconds on the clock.
    """

    frame: Frame
    rendered: RenderedFrame
    at: float


class PipelineSupervisor:
    """Owns the health of the pipeline, and the workers. Used by one thread.

    The workers' threads only put messages into a queue, which that thread empties. Pictures alone do not wait for it:
    a worker's thread hands them on by `publish` at once, because waiting would cost latency.

    Attributes:
        pipeline: the one at work, or that was last; None before the first. Any thread may read this.
        load: how late pictures are, and so what the next one may cost. Any thread may read this.
        dropped: frames that no worker took. Any thread may read this.
    """

    def __init__(
        self,
        first: Pipeline | None,
        make_pipeline: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        publish: Callable[[Frame, RenderedFrame], bool],
        on_trouble: Callable[[Exception | None], None],
        limits: HealthLimits = DEFAULT_LIMITS,
        clock: Clock = SYSTEM_CLOCK,
        start_worker: WorkerFactory = PipelineWorker,
        quality_limits: QualityLimits = DEFAULT_QUALITY_LIMITS,
    ) -> None:
        """Set up; the first frame starts a worker.

        Args:
            first: the pipeline to begin with; None where one cannot be made yet.
            make_pipeline: makes another; called in a worker's thread.
            scene: gives the present scene.
            publish: takes a frame and its picture, in a worker's thread. Returns whether the picture is shown.
            on_trouble: takes each error, and None when a picture was rendered after one.
            limits: how long work may take until it is given up.
            clock: to measure by.
            start_worker: starts a worker.
            quality_limits: when pictures are made cheaper.
        """
        self.pipeline = first
        self.dropped = 0
        self._next_pipeline: Callable[[], Pipeline] = make_pipeline if first is None else lambda: first
        self._make_pipeline, self._scene, self._publish, self._on_trouble = make_pipeline, scene, publish, on_trouble
        self._limits, self._clock, self._start_worker = limits, clock, start_worker
        self._quality_limits = quality_limits
        self._health = PipelineHealth()
        self.load = QualityState()
        self._messages: queue.SimpleQueue[Event | tuple[PictureRendered, ShownPicture]] = queue.SimpleQueue()
        self._worker: Worker | None = None
        self._retired: dict[int, Worker] = {}  # replaced, never modified: `close` reads it in another thread
        self._closed = False
        self._replacement: Callable[[], Pipeline] | None = None  # put by any thread, taken by the one of the frames
        self._dropped_by_retired = 0
        self._since_rendered = self._passed_over = 0
        self._looked_at = clock.now()
        self._paused_s = 0.0
        self._run_delay_s: float | None = None

    @property
    def health(self) -> PipelineHealth:
        """What is known of the pipeline. Any thread may read this."""
        return self._health

    def handle_messages(self) -> list[ShownPicture]:
        """Take in what the workers did since the last call. Returns the pictures that were shown."""
        now, before, shown = self._clock.now(), self._looked_at, []
        self._looked_at, self._paused_s = now, self._paused_s + max(0.0, now - before - LATE_S)
        while not self._messages.empty():
            message = self._messages.get()
            if isinstance(message, tuple):
                event, picture = message
                shown.append(picture)
                self._apply(event)
                latency_s = picture.at - picture.frame.captured_at
                self.load = next_quality(self.load, picture.at, latency_s, self._quality_limits)
            else:
                self._apply(message)
        # Counted at each look, not at each frame: a worker counts when it takes a frame, after which none may follow.
        self.dropped = self._passed_over + self._dropped_by_retired + (self._worker.dropped if self._worker else 0)
        return shown

    def submit_frame(self, frame: Frame) -> bool:
        """Hand a frame to the pipeline. Returns whether its picture can be expected; if not, show the fallback."""
        replacement, self._replacement = self._replacement, None
        if replacement is not None:
            self._next_pipeline = replacement
            self._apply(ReplacementAsked())
        paused_s, self._paused_s = self._paused_s, 0.0
        now = self._clock.now()
        actions = self._apply(FrameArrived(now, self._scene().revision, paused_s, self._starved_s()), frame)
        if self._worker is not None:
            self.pipeline = self._worker.pipeline or self.pipeline
        if self.pipeline is not None:
            self.pipeline.quality = self.load.quality
        return ShowFallback() not in actions

    def replace_pipeline(self, first: Callable[[], Pipeline] | None = None) -> None:
        """Put another pipeline in the place of the one at work, with the next frame. Any thread may call this.

        Args:
            first: makes it, in a worker's thread; what makes all of them if not given.
        """
        self._replacement = first or self._make_pipeline

    def close(self) -> None:
        """Let all workers end; see `ended`. May be called from another thread."""
        self._closed = True
        for worker in self._workers():
            worker.close()

    def ended(self, by: float) -> bool:
        """Whether all workers have ended, waiting until `by` on the clock. Call after `close`."""
        return all(worker.ended(max(0.0, by - self._clock.now())) for worker in self._workers())

    def _starved_s(self) -> float:
        """For how long the worker has waited for a processor since the last call."""
        before, self._run_delay_s = self._run_delay_s, self._worker.run_delay_s if self._worker else None
        # 0 where the system did not tell, too: from there to what it tells next nobody has waited.
        return max(0.0, self._run_delay_s - before) if self._run_delay_s and before else 0.0

    def _workers(self) -> list[Worker]:
        return [*self._retired.values(), *([self._worker] if self._worker else [])]

    def _apply(self, event: Event, frame: Frame | None = None) -> tuple[Action, ...]:
        self._health, actions = next_health(self._health, event, self._limits)
        for action in actions:
            self._act(action, frame)
        if isinstance(event, WorkerEnded):
            self._retired = {number: self._retired[number] for number in self._health.abandoned}
        return actions

    def _act(self, action: Action, frame: Frame | None) -> None:
        if isinstance(action, StartWorker):
            self._worker = self._start_worker(
                action.worker, self._next_pipeline, self._scene, self._messages.put, self._receive_picture, self._clock
            )
            self._next_pipeline = self._make_pipeline
            if self._closed:
                self._worker.close()
        elif isinstance(action, RetireWorker):
            assert self._worker is not None
            self._worker.close()
            self._retired = {**self._retired, action.worker: self._worker}
            self._dropped_by_retired += self._worker.dropped
            self._worker = self._run_delay_s = None
        elif isinstance(action, SubmitFrame):
            assert self._worker is not None
            assert frame is not None
            self._since_rendered += 1
            if self._since_rendered >= self.load.quality.render_every:
                self._since_rendered = 0
                self._worker.submit_frame(frame)
            else:
                self._passed_over += 1
        elif isinstance(action, ReportFailure):
            self._on_trouble(action.error)
        elif isinstance(action, ReportHang):
            assert self._worker is not None
            self._on_trouble(_hang_error(action, self._worker.stages))
        elif isinstance(action, ReportRecovery):
            self._on_trouble(None)

    def _receive_picture(self, event: PictureRendered, frame: Frame, rendered: RenderedFrame) -> None:
        """Publish a picture, in the worker's thread, unless the worker was retired meanwhile."""
        if event.worker != self._health.worker:
            return
        if self._publish(frame, rendered):
            self._messages.put((event, ShownPicture(frame, rendered, event.at)))
        else:
            self._messages.put(event)


def _hang_error(hang: ReportHang, stages: str) -> PipelineHangError:
    if hang.starved:
        return PipelineHangError(
            f"other programs keep the computer so busy that no picture was rendered for some seconds (in: {stages})",
            "a fallback picture is shown until there is time again; end what else is running",
        )
    return PipelineHangError(
        f"the pipeline has rendered no picture for some seconds (in: {stages})",
        "a fallback picture is shown and the pipeline is restarted by itself; "
        "if that does not help, restart the camera",
    )
