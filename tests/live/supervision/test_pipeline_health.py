"""The state machine of the pipeline's health: single decisions, and what holds in every order of events."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from relit_camera.base.errors import RelitError, TrackError
from relit_camera.live.supervision.pipeline_health import (
    Action,
    Event,
    FrameArrived,
    FrameFailed,
    FrameFinished,
    FrameStarted,
    HealthLimits,
    ModelsOpening,
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

LIMITS = HealthLimits()
FAULT, OWN_ERROR = ZeroDivisionError("a bug"), TrackError("a track that ends")


class Script:
    """Feeds events to a health that begins anew, and keeps the actions."""

    def __init__(self, limits: HealthLimits = LIMITS) -> None:
        self.health, self.limits = PipelineHealth(), limits
        self.actions: list[Action] = []

    def __call__(self, event: Event) -> tuple[Action, ...]:
        self.health, actions = next_health(self.health, event, self.limits)
        self.actions += actions
        return actions

    def arrive(self, at: float, revision: int = 0) -> tuple[Action, ...]:
        return self(FrameArrived(at, revision))

    def start(self, at: float, worker: int = 0) -> None:
        assert self(FrameStarted(worker, at)) == ()

    def render(self, at: float, worker: int = 0, begun_at: float | None = None) -> tuple[Action, ...]:
        """A worker renders a picture and is ready for the next frame."""
        self(FrameFinished(worker))
        return self(PictureRendered(worker, at, at if begun_at is None else begun_at))

    def fail(self, at: float, error: Exception = OWN_ERROR, worker: int = 0, revision: int = 0) -> tuple[Action, ...]:
        self(FrameFinished(worker))
        return self(FrameFailed(worker, at, at, revision, error))


def working(limits: HealthLimits = LIMITS) -> Script:
    """A pipeline that has rendered a picture, at 0 s."""
    script = Script(limits)
    assert script.arrive(0.0) == (StartWorker(0), SubmitFrame())
    script.start(0.0)
    assert script.render(0.0) == ()
    return script


def test_a_healthy_pipeline_gets_every_frame_and_nothing_is_said() -> None:
    script = working()
    for number in range(1, 100):
        assert script.arrive(number / 30) == (SubmitFrame(),)
        script.start(number / 30)
        assert script.render(number / 30 + 0.02) == ()


def test_after_a_failure_it_is_tried_again_with_growing_pauses() -> None:
    script, at = working(), 10.0
    for pause in (1, 2, 4, 8, 16, 16, 16):
        assert script.fail(at) == (ReportFailure(OWN_ERROR),)
        assert script.arrive(at + pause - 0.01) == (ShowFallback(),)
        assert script.arrive(at + pause) == (SubmitFrame(), ShowFallback())
        at += pause
    assert script.render(at) == (ReportRecovery(),)
    assert script.arrive(at) == (SubmitFrame(),)
    script.fail(at)
    assert script.arrive(at + 0.99) == (ShowFallback(),)  # from one second again
    assert script.arrive(at + 1.0) == (SubmitFrame(), ShowFallback())


def test_another_scene_is_tried_at_once_during_the_pause() -> None:
    script = working()
    script.fail(10.0, revision=4)
    assert script.arrive(10.1, revision=4) == (ShowFallback(),)
    assert script.arrive(10.2, revision=5) == (SubmitFrame(), ShowFallback())
    script.fail(10.3, revision=5)
    assert script.arrive(11.9, revision=5) == (ShowFallback(),)  # the second pause takes two seconds
    assert script.arrive(12.4, revision=5) == (SubmitFrame(), ShowFallback())


def test_after_thousands_of_failures_the_pause_is_as_long_as_after_five() -> None:
    script = working()
    for number in range(5000):
        script.fail(float(number))
    assert script.health.failures == 5000
    assert script.arrive(4999 + 16.0) == (SubmitFrame(), ShowFallback())
    assert script.render(5016.0) == (ReportRecovery(),)


def test_three_faults_in_a_row_restart_the_worker_after_the_pause() -> None:
    script = working()
    for at in (10.0, 11.0, 13.0):
        script.fail(at, FAULT)
    assert script.arrive(16.9) == (ShowFallback(),)
    assert script.arrive(17.0) == (RetireWorker(0), ShowFallback())
    assert script.arrive(17.1) == (StartWorker(1), SubmitFrame(), ShowFallback())
    script.start(17.1, worker=1)
    assert script.render(17.2, worker=1) == (ReportRecovery(),)


def test_errors_that_are_no_faults_restart_nothing() -> None:
    script = working()
    for number in range(50):
        script.fail(20.0 * number)
        script.arrive(20.0 * number + 19.9)
    assert not [action for action in script.actions if isinstance(action, RetireWorker)]


def test_the_picture_of_a_frame_before_the_failed_one_is_no_recovery() -> None:
    script = working()
    script.start(10.0)
    script(FrameFinished(0))  # its picture is in the making
    script.start(10.03)
    script(FrameFailed(0, 10.04, 10.03, 0, OWN_ERROR))
    assert script.render(10.05, begun_at=10.0) == ()
    assert script.arrive(10.06) == (ShowFallback(),)
    assert script.arrive(11.1) == (SubmitFrame(), ShowFallback())
    assert script.render(11.2, begun_at=11.1) == (ReportRecovery(),)


def test_the_picture_of_a_frame_after_the_failed_one_is_a_recovery() -> None:
    script = working()
    script(FrameFailed(0, at=10.05, begun_at=10.0, scene_revision=0, error=OWN_ERROR))  # in its second half
    assert script.render(10.08, begun_at=10.03) == (ReportRecovery(),)


def test_a_hang_is_reported_once_after_two_seconds_and_the_worker_replaced_after_ten() -> None:
    script = working()
    script.start(10.0)
    assert script.arrive(12.0) == (SubmitFrame(),)
    assert script.arrive(12.1) == (ReportHang(0), ShowFallback())
    assert script.arrive(19.9) == (ShowFallback(),)
    assert script.arrive(20.1) == (RetireWorker(0), ShowFallback())
    assert script.arrive(20.2) == (StartWorker(1), SubmitFrame(), ShowFallback())
    script.start(20.2, worker=1)
    assert script.render(25.0, worker=1) == (ReportRecovery(),)
    assert script.arrive(25.1) == (SubmitFrame(),)


def arrive_each_second(script: Script, since: int, until: int, starved_s: float) -> dict[int, tuple[Action, ...]]:
    """Frames that arrive each second, between which the worker waits so long for a processor; what is done."""
    return {at: script(FrameArrived(float(at), 0, starved_s=starved_s)) for at in range(since, until)}


def test_a_worker_that_waits_for_a_processor_is_not_replaced_for_a_minute() -> None:
    script = working()
    script.start(10.0)
    done = arrive_each_second(script, 11, 72, starved_s=0.95)
    assert done[12] == (SubmitFrame(),)
    assert done[13] == (ReportHang(0, starved=True), ShowFallback())
    assert {done[at] for at in range(14, 71)} == {(ShowFallback(),)}
    assert done[71] == (RetireWorker(0), ShowFallback())  # that it computes for ever is not ruled out


def test_a_picture_after_starving_is_a_recovery() -> None:
    script = working()
    script.start(10.0)
    arrive_each_second(script, 11, 40, starved_s=0.95)
    assert script.render(40.1, begun_at=10.0) == (ReportRecovery(),)
    assert script.arrive(40.2) == (SubmitFrame(),)


def test_only_what_the_worker_did_not_wait_for_a_processor_counts() -> None:
    script = working()
    script.start(10.0)
    done = arrive_each_second(script, 11, 32, starved_s=0.5)
    assert done[13] == (ReportHang(0), ShowFallback())  # it waited for half of the time, no more
    assert done[30] == (ShowFallback(),)
    assert done[31] == (RetireWorker(0), ShowFallback())


def test_a_frame_waits_for_the_picture_of_the_one_before_and_that_is_no_hang() -> None:
    """One frame is rendered while the next is begun: a slow picture is not followed by a hang at once."""
    script = working()
    script.start(10.0)
    script(FrameFinished(0))
    script.start(11.0)
    assert script(PictureRendered(0, 12.9, begun_at=10.0)) == ()
    assert script.arrive(14.8) == (SubmitFrame(),)
    assert script.arrive(15.0) == (ReportHang(0), ShowFallback())
    assert script.arrive(23.0) == (RetireWorker(0), ShowFallback())


def test_waiting_for_a_processor_counts_for_one_frame() -> None:
    script = working()
    script.start(10.0)
    arrive_each_second(script, 11, 40, starved_s=0.95)
    script.render(40.0, begun_at=10.0)
    script.start(41.0)
    done = arrive_each_second(script, 42, 53, starved_s=0.0)
    assert done[44] == (ReportHang(0), ShowFallback())
    assert done[52] == (RetireWorker(0), ShowFallback())


def test_a_program_that_was_stopped_does_not_hang() -> None:
    script = working()
    script.start(10.0)
    assert script(FrameArrived(3611.0, 0, paused_s=3600.0)) == (SubmitFrame(),)
    assert script.arrive(3612.0) == (SubmitFrame(),)
    assert script.arrive(3612.1) == (ReportHang(0), ShowFallback())  # two seconds of its own
    assert script.arrive(3620.1) == (RetireWorker(0), ShowFallback())


def test_what_a_frame_did_not_see_of_a_pause_does_not_count_for_it() -> None:
    script = working()
    script.start(3610.9)  # after the pause, before the supervisor has run
    assert script(FrameArrived(3611.0, 0, paused_s=3600.0)) == (SubmitFrame(),)
    assert script.arrive(3613.2) == (ReportHang(0), ShowFallback())


def test_a_hang_that_ends_by_itself_is_a_recovery() -> None:
    script = working()
    script.start(10.0)
    assert script.arrive(15.0) == (ReportHang(0), ShowFallback())
    assert script.render(15.1, begun_at=10.0) == (ReportRecovery(),)
    assert script.arrive(15.2) == (SubmitFrame(),)
    script.start(15.2)
    assert script.arrive(17.3) == (ReportHang(0), ShowFallback())  # another is reported again


def test_the_first_picture_may_take_longer_because_models_are_opened() -> None:
    script = Script()
    script.arrive(0.0)
    script.start(0.0)
    assert script.arrive(9.9) == (ShowFallback(),)
    assert script.arrive(10.1) == (ReportHang(0), ShowFallback())
    assert script.arrive(59.9) == (ShowFallback(),)
    assert script.arrive(60.1) == (RetireWorker(0), ShowFallback())


def test_models_that_are_opened_later_may_take_as_long() -> None:
    script = working()
    script.start(100.0)
    assert script(ModelsOpening(0, 100.1)) == ()
    assert script.arrive(109.9) == (ShowFallback(),)
    assert script.arrive(110.1) == (ReportHang(0), ShowFallback())
    assert script.arrive(159.9) == (ShowFallback(),)
    assert script.arrive(160.1) == (RetireWorker(0), ShowFallback())


def test_once_the_models_are_open_a_hang_is_reported_after_two_seconds_again() -> None:
    script = working()
    script.start(100.0)
    script(ModelsOpening(0, 100.1))
    assert script.render(130.0, begun_at=100.0) == ()  # nothing was reported
    script.start(130.0)
    script.render(130.1, begun_at=130.0)
    script.start(131.0)
    assert script.arrive(133.1) == (ReportHang(0), ShowFallback())


def test_a_picture_of_the_frame_before_does_not_end_the_patience() -> None:
    """It is rendered in the worker's other thread, while the models are opened for the next frame."""
    script = working()
    script.start(99.9)
    script(FrameFinished(0))
    script.start(100.0)
    script(ModelsOpening(0, 100.1))
    script(PictureRendered(0, 100.2, begun_at=99.9))
    assert script.arrive(109.9) == (ShowFallback(),)


def test_models_that_a_retired_worker_opens_change_nothing() -> None:
    script = working()
    script.start(10.0)
    script.arrive(20.1)
    script.arrive(20.2)
    script.start(20.2, worker=1)
    script.render(21.0, worker=1)
    before = script.health
    assert script(ModelsOpening(0, 22.0)) == ()
    assert script.health == before


def test_each_abandoned_worker_doubles_the_patience_with_the_next() -> None:
    script, at = working(HealthLimits(first_frame_factor=1, max_abandoned_workers=10)), 0.0
    for worker, patience in enumerate((10, 20, 40, 80, 160, 160)):
        script.start(at, worker)
        assert RetireWorker(worker) not in script.arrive(at + patience)
        assert RetireWorker(worker) in script.arrive(at + patience + 0.1)
        at += patience + 1
        assert StartWorker(worker + 1) in script.arrive(at)


def test_after_a_picture_the_patience_is_ten_seconds_again() -> None:
    script = working()
    script.start(10.0)
    script.arrive(20.1)
    script.arrive(20.2)
    script.start(20.2, worker=1)
    script.render(21.0, worker=1)
    script.start(30.0, worker=1)
    assert RetireWorker(1) in script.arrive(40.1)


def test_with_three_abandoned_workers_none_is_started_until_one_ends() -> None:
    script = working(HealthLimits(first_frame_factor=1))
    at = 10.0
    for worker in range(3):
        script.start(at, worker)
        at += 100.0
        assert RetireWorker(worker) in script.arrive(at)
        started = script.arrive(at)
    assert started == (ShowFallback(),)
    assert script.arrive(at + 86400) == (ShowFallback(),)
    script(WorkerEnded(1))
    assert script.arrive(at + 86401) == (StartWorker(3), SubmitFrame(), ShowFallback())
    assert script.health.abandoned == {0, 2}


def test_a_retired_worker_that_finishes_late_changes_nothing() -> None:
    script = working()
    script.start(10.0)
    script.arrive(20.1)
    script.arrive(20.2)
    script.start(20.2, worker=1)
    before = script.health
    for late in (
        FrameFinished(0),
        PictureRendered(0, 21.0, 10.0),
        FrameFailed(0, 21.0, 10.0, 0, FAULT),
        FrameStarted(0, 21.0),
    ):
        assert script(late) == ()
        assert script.health == before
    assert script.arrive(21.0) == (SubmitFrame(), ShowFallback())  # still waiting for worker 1
    assert script.render(22.0, worker=1, begun_at=20.2) == (ReportRecovery(),)


def test_a_failure_and_a_hang_together_are_both_reported_and_end_in_one_recovery() -> None:
    script = working()
    script.start(10.0)
    script(FrameFailed(0, 10.1, 9.97, 0, FAULT))  # the frame before, in its second half
    assert script.arrive(10.2) == (ShowFallback(),)
    assert script.arrive(12.1) == (ReportHang(0), ShowFallback())
    assert script.arrive(20.1) == (RetireWorker(0), ShowFallback())
    # The pause after the failure is over by now, so the new worker gets the next frame.
    assert script.arrive(20.2) == (StartWorker(1), SubmitFrame(), ShowFallback())
    script.start(20.2, worker=1)
    assert script.render(20.5, worker=1) == (ReportRecovery(),)


def test_a_worker_that_hangs_after_three_faults_is_replaced_once() -> None:
    script = working()
    for at in (10.0, 11.0, 13.0):
        script.fail(at, FAULT)
    script.start(13.1)
    script.arrive(15.2)
    assert script.arrive(23.2) == (RetireWorker(0), ShowFallback())
    assert script.arrive(23.3) == (StartWorker(1), SubmitFrame(), ShowFallback())  # and not retired at once


def test_a_replacement_comes_with_the_next_frame_even_in_the_pause_after_a_failure() -> None:
    script = working()
    script.fail(10.0)
    assert script.arrive(10.1) == (ShowFallback(),)
    assert script(ReplacementAsked()) == (RetireWorker(0),)
    assert script.arrive(10.2) == (StartWorker(1), SubmitFrame(), ShowFallback())
    script.start(10.2, worker=1)
    assert script.render(10.3, worker=1) == (ReportRecovery(),)


# What holds whatever happens, in whatever order.

QUICK = HealthLimits(
    retry_s=1.0,
    max_backoff_doublings=2,
    hang_timeout_s=2.0,
    abandon_timeout_s=4.0,
    first_frame_factor=2,
    max_abandoned_workers=2,
    faults_before_restart=2,
)


def check_transition(before: PipelineHealth, event: Event, limits: HealthLimits) -> PipelineHealth:
    """Check one step, and give the health after it."""
    after, actions = next_health(before, event, limits)
    kinds = [type(action) for action in actions]
    if isinstance(event, FrameArrived):
        assert SubmitFrame in kinds or ShowFallback in kinds  # every frame leads to a picture
        assert (ShowFallback in kinds) or not after.in_trouble
    elif isinstance(event, ReplacementAsked):
        assert actions == (() if before.worker is None else (RetireWorker(before.worker),))
        assert after.worker is None
    else:
        assert not {SubmitFrame, ShowFallback, StartWorker, RetireWorker} & set(kinds)  # only frames drive
    if isinstance(event, WorkerEnded):
        assert after.worker == before.worker
    elif not isinstance(event, FrameArrived | ReplacementAsked) and event.worker != before.worker:
        assert after == before  # late
    assert len(after.abandoned) <= limits.max_abandoned_workers
    assert after.worker not in after.abandoned
    # What was said agrees with what is known.
    assert (ReportRecovery in kinds) == (before.in_trouble and not after.in_trouble)
    if after.in_trouble and not before.in_trouble:
        assert ReportFailure in kinds or ReportHang in kinds
    assert (ReportHang in kinds) == (after.hang_reported and not before.hang_reported)
    if RetireWorker in kinds:
        assert after.worker is None
        assert before.worker in after.abandoned
    if StartWorker in kinds:
        assert before.worker is None
    return after


def check_recovers(health: PipelineHealth, at: float, limits: HealthLimits) -> None:
    """Once all workers answer again it takes few frames, spread over the longest pause, until all is well."""
    for number in sorted(health.abandoned):
        health = check_transition(health, WorkerEnded(number), limits)
    if health.worker is not None:
        health = check_transition(health, FrameFinished(health.worker), limits)
    for _ in range(3):
        at += limits.retry_s * 2**limits.max_backoff_doublings
        health, actions = next_health(health, FrameArrived(at, 0), limits)
        if SubmitFrame() in actions:
            assert health.worker is not None
            health = check_transition(health, PictureRendered(health.worker, at, at), limits)
            assert not health.in_trouble
            assert next_health(health, FrameArrived(at, 0), limits)[1] == (SubmitFrame(),)
            return
    raise AssertionError(f"it does not recover: {health}")


def possible_events(health: PipelineHealth, at: float) -> Iterator[Event]:
    """All kinds of events that may come next: of the worker at work, and of one that was retired."""
    workers = [number for number in (health.worker, min(health.abandoned, default=None)) if number is not None]
    yield FrameArrived(at, 0)
    yield FrameArrived(at, 1)
    yield ReplacementAsked()
    for worker in workers:
        yield FrameStarted(worker, at)
        yield ModelsOpening(worker, at)
        yield FrameFinished(worker)
        yield PictureRendered(worker, at, at)
        yield PictureRendered(worker, at, at - 1.5)
        yield FrameFailed(worker, at, at, 0, FAULT)
        yield FrameFailed(worker, at, at - 1.5, 1, OWN_ERROR)
    for worker in health.abandoned:
        yield WorkerEnded(worker)


@pytest.mark.slow
def test_every_order_of_up_to_eight_events() -> None:
    """All of them, 3 s apart: long enough for a hang, a pause to end, or a worker to be abandoned."""
    reached = {PipelineHealth()}
    count = 0
    for step in range(8):
        at = 3.0 * step
        following = set()
        for health in reached:
            for event in possible_events(health, at):
                following.add(check_transition(health, event, QUICK))
                count += 1
        reached = following
        for health in reached:
            check_recovers(health, at, QUICK)
    assert count > 10_000
    assert {len(health.abandoned) for health in reached} == {0, 1, 2}


@given(st.lists(st.tuples(st.integers(0, 23), st.sampled_from([0.01, 0.5, 1.0, 2.5, 5.0, 30.0])), max_size=60))
def test_any_long_order_of_events(choices: list[tuple[int, float]]) -> None:
    health, at = PipelineHealth(), 0.0
    for choice, pause in choices:
        at += pause
        events = list(possible_events(health, at))
        health = check_transition(health, events[choice % len(events)], QUICK)
    check_recovers(health, at, QUICK)


@pytest.mark.parametrize("error", [FAULT, OWN_ERROR])
def test_only_our_own_errors_are_no_faults(error: Exception) -> None:
    script = working(HealthLimits(faults_before_restart=1))
    script.fail(1.0, error)
    assert script.health.restart_due is not isinstance(error, RelitError)
