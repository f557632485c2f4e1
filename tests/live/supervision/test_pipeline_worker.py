"""The worker's threads: which events come, in which order, and what comes no more once it is closed."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from typing import cast

import numpy as np
import pytest

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK
from relit_camera.base.config.look import Look
from relit_camera.base.errors import ModelError
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
from relit_camera.live.supervision.pipeline_worker import PipelineWorker

WAIT_S = 60.0
IMAGE = np.zeros((2, 2, 3), np.uint8)
SCENE = Scene(Look(), revision=7)


def frame(index: int) -> Frame:
    return Frame(IMAGE, index, 0.0, 0.0)


class FakePipeline:
    """Raises or waits in either half, by frame index; opens models for frame 9."""

    def __init__(self) -> None:
        self.on_opening: Callable[[], None] = pytest.fail
        self.closed = False
        self.begun: list[int] = []
        self.error_at: dict[int, Exception] = {}
        self.hold_begin: dict[int, threading.Event] = {}
        self.hold_render: dict[int, threading.Event] = {}

    def begin(self, frame: Frame, scene: object) -> RenderTask:
        self.begun.append(frame.index)
        if frame.index == 9:
            self.on_opening()
        if frame.index in self.hold_begin:
            self.hold_begin[frame.index].wait(WAIT_S)
        if frame.index in self.error_at:
            raise self.error_at[frame.index]

        def render() -> RenderedFrame:
            if frame.index in self.hold_render:
                self.hold_render[frame.index].wait(WAIT_S)
            return RenderedFrame(IMAGE, None, SCENE)

        return render

    def close(self) -> None:
        self.closed = True


class Working:
    """A worker, and a queue of what it posts; pictures are there as their event and the frame's index."""

    def __init__(self) -> None:
        self.pipeline = FakePipeline()
        self.make_error: Exception | None = None
        self.posted: queue.Queue[Event | tuple[PictureRendered, int]] = queue.Queue()
        self.worker = PipelineWorker(
            3,
            self._make,
            lambda: SCENE,
            self.posted.put,
            lambda event, frame, rendered: self.posted.put((event, frame.index)),
            SYSTEM_CLOCK,
        )

    def _make(self) -> Pipeline:
        if self.make_error is not None:
            raise self.make_error
        return cast(Pipeline, self.pipeline)

    def next(self) -> Event | tuple[PictureRendered, int]:
        return self.posted.get(timeout=WAIT_S)

    def next_kinds(self, count: int) -> set[str]:
        """The kinds of the next messages; those of its two threads may come in either order."""
        found = [self.next() for _ in range(count)]
        return {f"picture {each[1]}" if isinstance(each, tuple) else type(each).__name__ for each in found}


@pytest.fixture
def working() -> Iterator[Working]:
    made = Working()
    yield made
    for held in (*made.pipeline.hold_begin.values(), *made.pipeline.hold_render.values()):
        held.set()
    made.worker.close()
    assert made.worker.ended(WAIT_S)


def test_a_frame_is_started_finished_and_rendered(working: Working) -> None:
    assert working.worker.pipeline is None
    assert working.worker.stages == "opening models"
    working.worker.submit_frame(frame(5))
    started = working.next()
    assert isinstance(started, FrameStarted)
    assert started.worker == 3
    rest = [working.next(), working.next()]
    (finished,) = [each for each in rest if isinstance(each, FrameFinished)]
    (picture,) = [each for each in rest if isinstance(each, tuple)]
    assert finished.worker == picture[0].worker == 3
    assert picture[1] == 5
    assert picture[0].begun_at == started.at <= picture[0].at


def test_models_that_are_opened_are_told_before_the_frame_is_done(working: Working) -> None:
    working.worker.submit_frame(frame(9))
    started, opening = working.next(), working.next()
    assert isinstance(started, FrameStarted)
    assert isinstance(opening, ModelsOpening)
    assert opening.worker == 3
    assert opening.at >= started.at
    assert working.next_kinds(2) == {"FrameFinished", "picture 9"}


def test_a_closed_worker_closes_its_pipeline(working: Working) -> None:
    working.worker.submit_frame(frame(0))
    assert working.next_kinds(3) == {"FrameStarted", "FrameFinished", "picture 0"}
    assert not working.pipeline.closed
    working.worker.close()
    assert working.next() == WorkerEnded(3)
    assert working.pipeline.closed


def test_the_next_frame_is_begun_while_one_is_rendered_and_no_more(working: Working) -> None:
    held = working.pipeline.hold_render[0] = threading.Event()
    working.worker.submit_frame(frame(0))
    assert working.next_kinds(2) == {"FrameStarted", "FrameFinished"}
    working.worker.submit_frame(frame(1))
    assert working.next_kinds(1) == {"FrameStarted"}  # begun, but not finished while 0 is rendered
    for index in (2, 3, 4):
        working.worker.submit_frame(frame(index))
    with pytest.raises(queue.Empty):
        working.posted.get(timeout=0.3)
    held.set()
    pictures = working.next_kinds(6)  # of 0 and 1, the end of 1, and 4 started, finished, rendered
    assert {kind for kind in pictures if kind.startswith("picture")} == {"picture 0", "picture 1", "picture 4"}
    assert working.pipeline.begun == [0, 1, 4]
    assert working.worker.dropped == 2


@pytest.mark.parametrize("half", ["begin", "make"])
def test_a_frame_that_fails_is_reported_and_the_next_one_works(half: str, working: Working) -> None:
    error = ModelError("the face model is missing")
    if half == "make":
        working.make_error = error
    else:
        working.pipeline.error_at[0] = error
    working.worker.submit_frame(frame(0))
    started, failed = working.next(), working.next()
    assert isinstance(started, FrameStarted)
    assert isinstance(failed, FrameFailed)
    assert (failed.worker, failed.error, failed.scene_revision, failed.begun_at) == (3, error, 7, started.at)
    assert isinstance(working.next(), FrameFinished)
    working.make_error = None
    working.worker.submit_frame(frame(1))
    assert working.next_kinds(3) == {"FrameStarted", "FrameFinished", "picture 1"}


def test_a_closed_worker_that_hung_gives_no_picture_but_says_that_it_ended(working: Working) -> None:
    held = working.pipeline.hold_begin[0] = threading.Event()
    working.worker.submit_frame(frame(0))
    assert isinstance(working.next(), FrameStarted)
    working.worker.close()
    assert not working.worker.ended()
    held.set()
    assert working.next() == WorkerEnded(3)
    assert working.worker.ended(WAIT_S)
    assert working.posted.empty()


def test_a_picture_that_is_rendered_after_closing_is_dropped(working: Working) -> None:
    held = working.pipeline.hold_render[0] = threading.Event()
    working.worker.submit_frame(frame(0))
    assert working.next_kinds(2) == {"FrameStarted", "FrameFinished"}
    working.worker.close()
    held.set()
    assert working.next() == WorkerEnded(3)
    assert working.posted.empty()


def test_an_error_in_a_closed_worker_is_not_reported(working: Working) -> None:
    held = working.pipeline.hold_begin[0] = threading.Event()
    working.pipeline.error_at[0] = ZeroDivisionError("late")
    working.worker.submit_frame(frame(0))
    assert isinstance(working.next(), FrameStarted)
    working.worker.close()
    held.set()
    assert working.next() == WorkerEnded(3)
