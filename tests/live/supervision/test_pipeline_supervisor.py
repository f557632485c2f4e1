"""The supervisor in virtual time, with workers that take as long as the test says."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import pytest

from relit_camera.base.concurrency.clock import Clock
from relit_camera.base.config.look import Look
from relit_camera.base.errors import PipelineHangError, TrackError
from relit_camera.base.images.image_types import Frame
from relit_camera.live.pipeline import Pipeline, RenderedFrame
from relit_camera.live.render_quality import QUALITY_LEVELS, RenderQuality
from relit_camera.live.scene.scene import Scene
from relit_camera.live.supervision.adaptive_quality import QualityState
from relit_camera.live.supervision.pipeline_health import (
    Event,
    FrameFailed,
    FrameFinished,
    FrameStarted,
    HealthLimits,
    ModelsOpening,
    PictureRendered,
    WorkerEnded,
)
from relit_camera.live.supervision.pipeline_supervisor import PipelineSupervisor, Worker
from tests.virtual_clock import VirtualClock

FPS = 30.0
RENDER_S = 0.02
IMAGE = np.zeros((2, 2, 3), np.uint8)
HANG = 1e9


class FakePipeline:
    """In the place of a pipeline: a `FakeWorker` uses nothing of it."""

    quality = QUALITY_LEVELS[0]


class FakeWorker:
    """Takes `simulation.render_s` for a frame, or fails with `simulation.error` after as long."""

    stages = "track"

    def __init__(
        self,
        simulation: Simulation,
        number: int,
        make_pipeline: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        post: Callable[[Event], None],
        on_picture: Callable[[PictureRendered, Frame, RenderedFrame], None],
        clock: Clock,
    ) -> None:
        self.pipeline: Pipeline | None = make_pipeline()
        self.number, self._simulation, self._scene = number, simulation, scene
        self._post, self._on_picture = post, on_picture
        self._waiting: Frame | None = None
        self._busy = self.closed = False
        self.dropped, self.run_delay_s = 0, 0.0
        self._replaced = 0

    def submit_frame(self, frame: Frame) -> None:
        if self.closed:
            assert self._simulation.closing
        elif self._busy:
            self._replaced += self._waiting is not None
            self._waiting = frame
        else:
            self._begin(frame)

    def close(self) -> None:
        if not self._busy and not self.closed:
            self._post(WorkerEnded(self.number))
        self.closed = True

    def ended(self, timeout_s: float = 0.0) -> bool:
        return self.closed and not self._busy

    def _begin(self, frame: Frame) -> None:
        clock, begun_at = self._simulation.clock, self._simulation.clock.now()
        self._busy = True
        self._post(FrameStarted(self.number, begun_at))
        if self._simulation.opens_models:
            self._post(ModelsOpening(self.number, begun_at))
        error, scene = self._simulation.error, self._scene()
        clock.at(self._simulation.render_s, lambda: self.end(frame, begun_at, scene, error))

    def end(self, frame: Frame, begun_at: float, scene: Scene, error: Exception | None) -> None:
        """End a frame. The threads of a real worker may do so in the instant in which it is retired: so does this."""
        now = self._simulation.clock.now()
        self._busy = False
        self._post(FrameFinished(self.number))
        if error is not None:
            self._post(FrameFailed(self.number, now, begun_at, scene.revision, error))
        else:
            rendered = RenderedFrame(IMAGE, None, scene)
            self._on_picture(PictureRendered(self.number, now, begun_at), frame, rendered)
        if self.closed:
            self._post(WorkerEnded(self.number))
        elif self._waiting is not None:
            frame, self._waiting = self._waiting, None
            self.dropped = self._replaced  # as a real one does: it counts when it takes a frame
            self._begin(frame)


class Simulation:
    """A source of 30 frames a second and a supervisor. Schedule what happens, then `run`.

    Attributes:
        render_s: how long a frame takes that begins now.
        error: what a frame that begins now ends with.
        opens_models: whether a frame that begins now opens models.
        shown: when a picture was published or a fallback shown, and which: ("picture", worker) or ("fallback", -1).
        published: the indices of the frames whose pictures were published.
        troubles: when which error was reported; None for recovery.
    """

    def __init__(self, limits: HealthLimits = HealthLimits()) -> None:  # noqa: B008 - frozen
        self.clock = VirtualClock()
        self.start = self.clock.now()
        self.render_s, self.error = RENDER_S, cast(Exception | None, None)
        self.opens_models = False
        self.scene = Scene(Look())
        self.workers: list[FakeWorker] = []
        self.shown: list[tuple[float, str, int]] = []
        self.published: list[int] = []
        self.troubles: list[tuple[float, Exception | None]] = []
        self.frames = 0
        self.closing = False
        self.supervisor = PipelineSupervisor(
            cast(Pipeline, FakePipeline()),
            lambda: cast(Pipeline, FakePipeline()),
            lambda: self.scene,
            self._publish,
            lambda error: self.troubles.append((self.now(), error)),
            limits,
            self.clock,
            self._start_worker,
        )

    def now(self) -> float:
        return self.clock.now() - self.start

    def at(self, seconds: float, **changes: object) -> None:
        """Change attributes at a time."""

        def change() -> None:
            for name, value in changes.items():
                setattr(self, name, value)

        self.clock.at(seconds - self.now(), change)

    def run(self, until: float) -> None:
        """Let the source give frames until a time."""
        while self.now() < until:
            self.clock.sleep(1 / FPS)
            self.supervisor.handle_messages()
            frame = Frame(IMAGE, self.frames, self.clock.now(), self.now())
            self.frames += 1
            if not self.supervisor.submit_frame(frame):
                self.shown.append((self.now(), "fallback", -1))

    def reported(self) -> list[tuple[float, str]]:
        """When what was reported, to a tenth of a second."""
        return [(round(at, 1), "recovered" if error is None else type(error).__name__) for at, error in self.troubles]

    def longest_gap_s(self) -> float:
        """The longest time without a picture or fallback."""
        return float(np.diff([0.0, *(at for at, _, _ in self.shown), self.now()]).max())

    def quality(self) -> RenderQuality:
        """What the next picture may cost."""
        assert self.supervisor.pipeline is not None
        return self.supervisor.pipeline.quality

    def _publish(self, frame: Frame, rendered: RenderedFrame) -> bool:
        self.shown.append((self.now(), "picture", self.supervisor.health.worker or 0))
        self.published.append(frame.index)
        return True

    def _start_worker(
        self,
        number: int,
        make_pipeline: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        post: Callable[[Event], None],
        on_picture: Callable[[PictureRendered, Frame, RenderedFrame], None],
        clock: Clock,
    ) -> Worker:
        self.workers.append(FakeWorker(self, number, make_pipeline, scene, post, on_picture, clock))
        return self.workers[-1]


@pytest.mark.slow
def test_all_is_well_for_ten_minutes() -> None:
    simulation = Simulation()
    simulation.run(600.0)
    assert simulation.troubles == []
    assert len(simulation.shown) == pytest.approx(600 * FPS, abs=2)
    assert {kind for _, kind, _ in simulation.shown} == {"picture"}
    assert len(simulation.workers) == 1
    assert simulation.supervisor.dropped == 0


def test_a_slow_pipeline_drops_frames_but_does_not_hang() -> None:
    simulation = Simulation()
    simulation.render_s = 1.5
    simulation.run(60.0)
    assert simulation.troubles == []
    assert len(simulation.published) == pytest.approx(40, abs=1)


def test_frames_that_were_dropped_are_counted_though_no_frame_follows() -> None:
    simulation = Simulation()
    simulation.render_s = 1.5
    simulation.run(60.0)
    simulation.clock.sleep(4.0)  # the source is released; the last frame is taken and rendered meanwhile
    simulation.supervisor.handle_messages()
    assert len(simulation.published) + simulation.supervisor.dropped == simulation.frames


def test_a_pipeline_that_starves_is_shown_as_such_and_kept() -> None:
    simulation = Simulation()
    simulation.run(10.0)
    worker = simulation.workers[0]

    def starve() -> None:
        worker.run_delay_s += 0.095

    simulation.render_s = 30.0
    simulation.clock.every(0.1, starve)
    simulation.run(11.0)
    simulation.render_s = RENDER_S
    simulation.run(60.0)
    assert simulation.reported() == [(12.1, "PipelineHangError"), (40.1, "recovered")]
    assert "other programs" in str(simulation.troubles[0][1])
    assert simulation.workers == [worker]
    assert {kind for at, kind, _ in simulation.shown if 12.2 < at < 40.0} == {"fallback"}
    assert {kind for at, kind, _ in simulation.shown if at > 40.1} == {"picture"}


def test_what_a_worker_waits_from_the_start_of_a_frame_counts() -> None:
    simulation = Simulation(HealthLimits(hang_timeout_s=0.4, abandon_timeout_s=1.0))
    simulation.run(1.0)
    simulation.workers[0].run_delay_s = 0.1
    simulation.run(10.0)

    def starve() -> None:
        simulation.workers[0].run_delay_s += 0.06  # of each tenth of a second: just over the half

    simulation.render_s = 3.0
    simulation.clock.every(0.1, starve)
    simulation.run(12.0)
    assert "other programs" in str(simulation.troubles[0][1])


def test_a_program_that_stands_still_for_a_minute_has_nothing_to_report() -> None:
    simulation = Simulation()
    simulation.run(10.0)
    simulation.render_s = 61.0
    simulation.run(10.1)
    simulation.render_s = RENDER_S
    simulation.clock.sleep(60.0)  # the supervisor comes back before the worker has ended its frame
    simulation.run(80.0)
    assert simulation.troubles == []
    assert len(simulation.workers) == 1
    simulation.render_s = HANG
    simulation.run(100.0)
    assert simulation.reported()[0] == (82.1, "PipelineHangError")


def test_errors_are_retried_after_1_2_4_8_and_then_every_16_seconds() -> None:
    simulation = Simulation()
    simulation.at(10.0, error=TrackError("a track that ends"))
    simulation.run(10.0 + 78.0)
    times = [at for at, error in simulation.troubles if error is not None]
    np.testing.assert_allclose(np.diff(times), [1, 2, 4, 8, 16, 16, 16], atol=0.1)
    assert simulation.longest_gap_s() < 0.1
    simulation.at(90.0, error=None)
    simulation.run(110.0)
    assert simulation.reported()[-1][1] == "recovered"
    assert simulation.shown[-1][1] == "picture"
    assert len(simulation.workers) == 1


def test_three_faults_in_a_row_bring_a_new_pipeline() -> None:
    simulation = Simulation()
    first = simulation.supervisor.pipeline
    simulation.at(10.0, error=ZeroDivisionError("a bug"))
    simulation.at(14.0, error=None)
    simulation.run(20.0)
    assert [name for _, name in simulation.reported()] == ["ZeroDivisionError"] * 3 + ["recovered"]
    assert len(simulation.workers) == 2
    assert simulation.workers[0].closed
    assert simulation.supervisor.pipeline is not first


def test_another_scene_is_tried_at_once() -> None:
    simulation = Simulation()
    simulation.at(10.0, error=TrackError("this subject has no face"))
    simulation.run(12.0)
    simulation.at(12.5, error=None, scene=Scene(Look(), revision=1))
    simulation.run(14.0)
    assert simulation.reported()[-1] == (12.6, "recovered")  # the second pause lasts until 13


def test_a_hang_shows_the_fallback_after_two_seconds_and_another_worker_after_ten() -> None:
    simulation = Simulation()
    simulation.at(10.0, render_s=HANG)
    simulation.at(11.0, render_s=RENDER_S)  # the next worker is healthy
    simulation.run(30.0)
    assert simulation.reported() == [(12.1, "PipelineHangError"), (20.1, "recovered")]
    error = simulation.troubles[0][1]
    assert isinstance(error, PipelineHangError)
    assert "in: track" in error.what
    assert "fallback picture" in error.cure
    assert simulation.longest_gap_s() < 2.1
    assert [worker.number for worker in simulation.workers] == [0, 1]
    assert simulation.shown[-1][1:] == ("picture", 1)


def test_a_subject_whose_models_open_slowly_is_no_hang() -> None:
    simulation = Simulation()
    simulation.at(10.0, render_s=45.0, opens_models=True)
    simulation.at(11.0, render_s=RENDER_S, opens_models=False)
    simulation.run(120.0)
    assert simulation.reported() == [(20.1, "PipelineHangError"), (55.1, "recovered")]
    assert len(simulation.workers) == 1
    assert simulation.longest_gap_s() < 2.1
    simulation.at(130.0, render_s=HANG)  # with the models open the patience is ten seconds again
    simulation.at(131.0, render_s=RENDER_S)
    simulation.run(150.0)
    assert simulation.reported()[2:] == [(132.1, "PipelineHangError"), (140.1, "recovered")]
    assert len(simulation.workers) == 2


def test_a_retired_worker_that_ends_late_shows_and_says_nothing() -> None:
    simulation = Simulation()
    simulation.at(10.0, render_s=30.0)  # until 40
    simulation.at(11.0, render_s=RENDER_S)
    simulation.run(39.9)
    assert simulation.supervisor.health.abandoned == {0}
    reported, pictures = simulation.reported(), len(simulation.shown)
    simulation.run(41.0)
    assert simulation.supervisor.health.abandoned == frozenset()
    assert simulation.reported() == reported
    assert len(simulation.shown) - pictures == pytest.approx(1.1 * FPS, abs=1)  # one a frame
    assert simulation.published == sorted(simulation.published)  # none of them of its old frame


def test_workers_that_all_hang_leave_three_behind_and_one_that_ends_makes_room() -> None:
    simulation = Simulation(HealthLimits(first_frame_factor=1))
    simulation.at(10.0, render_s=HANG)
    simulation.run(300.0)
    assert len(simulation.workers) == 3
    assert simulation.supervisor.health.abandoned == {0, 1, 2}
    assert simulation.shown[-1][1] == "fallback"
    assert simulation.longest_gap_s() < 2.1
    simulation.render_s = RENDER_S
    simulation.workers[1].end(Frame(IMAGE, 0, 0.0, 0.0), 0.0, simulation.scene, None)
    simulation.run(302.0)
    assert len(simulation.workers) == 4
    assert simulation.reported()[-1] == (300.1, "recovered")


def test_models_may_take_a_minute_to_open() -> None:
    simulation = Simulation()
    simulation.render_s = 9.0
    simulation.at(1.0, render_s=RENDER_S)
    simulation.run(20.0)
    assert simulation.troubles == []  # not reported, though a fallback is shown
    slower = Simulation()
    slower.render_s = 50.0
    slower.at(1.0, render_s=RENDER_S)
    slower.run(60.0)
    assert slower.reported() == [(10.1, "PipelineHangError"), (50.1, "recovered")]
    assert len(slower.workers) == 1


def test_a_worker_that_is_started_while_the_camera_closes_is_closed_at_once() -> None:
    simulation = Simulation()
    simulation.closing = True
    simulation.supervisor.close()  # by another thread, while a frame is on its way
    simulation.supervisor.submit_frame(Frame(IMAGE, 0, 0.0, 0.0))
    assert [worker.closed for worker in simulation.workers] == [True]


def test_closing_closes_all_workers() -> None:
    simulation = Simulation()
    simulation.at(10.0, render_s=HANG)
    simulation.at(11.0, render_s=RENDER_S)
    simulation.run(25.0)
    simulation.supervisor.close()
    assert [worker.closed for worker in simulation.workers] == [True, True]
    assert not simulation.supervisor.ended(by=simulation.clock.now())  # the first still hangs


def test_late_pictures_get_cheaper_and_full_quality_comes_back_within_two_seconds() -> None:
    simulation = Simulation()
    simulation.at(5.0, render_s=0.2)
    simulation.run(5.0)
    assert simulation.quality() == QUALITY_LEVELS[0]
    simulation.run(8.0)
    assert simulation.quality() == QUALITY_LEVELS[-1]
    simulation.at(8.0, render_s=RENDER_S)
    simulation.run(10.0)
    assert simulation.quality() == QUALITY_LEVELS[0]
    assert simulation.troubles == []


def test_at_the_last_level_every_second_frame_is_rendered() -> None:
    simulation = Simulation()
    simulation.run(1.0)
    simulation.supervisor.load = QualityState(level=len(QUALITY_LEVELS) - 1, latency_s=0.07)
    count = len(simulation.published)
    simulation.run(1.3)
    assert set(np.diff(simulation.published[count + 1 :])) == {2}
    simulation.run(4.0)
    count = len(simulation.published)
    simulation.run(5.0)
    assert set(np.diff(simulation.published[count:])) == {1}
    assert simulation.supervisor.dropped == pytest.approx(0.4 * FPS / 2, abs=2)


def test_models_that_open_slowly_are_no_reason_for_cheaper_pictures() -> None:
    simulation = Simulation()
    simulation.render_s, simulation.opens_models = 3.0, True
    simulation.at(0.1, render_s=RENDER_S, opens_models=False)
    levels = set()
    for until in np.arange(0.1, 6.0, 0.1):
        simulation.run(float(until))
        levels.add(simulation.supervisor.load.level)
    assert levels == {0}


def test_a_new_worker_begins_with_the_quality_that_the_load_allows() -> None:
    simulation = Simulation()
    simulation.render_s = 0.2
    simulation.run(5.0)
    simulation.at(5.0, render_s=HANG)
    simulation.at(5.5, render_s=0.2)
    simulation.run(17.0)
    assert len(simulation.workers) > 1
    assert simulation.quality() == QUALITY_LEVELS[-1]


def test_a_replaced_pipeline_takes_the_next_frame_and_the_old_one_ends() -> None:
    simulation = Simulation()
    simulation.run(2.0)
    simulation.supervisor.replace_pipeline()
    simulation.run(4.0)
    assert [worker.number for worker in simulation.workers] == [0, 1]
    assert simulation.workers[0].closed
    assert simulation.supervisor.health.abandoned == frozenset()
    assert simulation.troubles == []
    assert simulation.longest_gap_s() < 0.1
    assert simulation.shown[-1][1:] == ("picture", 1)


def test_what_replaces_it_is_made_by_what_was_given_once() -> None:
    simulation = Simulation()
    simulation.run(1.0)
    other = cast(Pipeline, FakePipeline())
    simulation.supervisor.replace_pipeline(lambda: other)
    simulation.run(2.0)
    assert simulation.supervisor.pipeline is other
    simulation.supervisor.replace_pipeline()
    simulation.run(3.0)
    assert simulation.supervisor.pipeline is not other


def test_a_replacement_is_tried_at_once_after_a_failure() -> None:
    simulation = Simulation()
    simulation.at(10.0, error=TrackError("models are missing"))
    simulation.run(60.0)  # the pauses are sixteen seconds by now
    simulation.error = None
    simulation.supervisor.replace_pipeline()
    simulation.run(60.2)
    assert simulation.reported()[-1][1] == "recovered"
