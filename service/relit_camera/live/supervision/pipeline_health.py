"""When the pipeline counts as failing or hanging, and what is done about it: a state machine without threads or clock.

`next_health` takes the health and an event and gives the health after it and the actions to take. Whoever owns the
health (`pipeline_supervisor.PipelineSupervisor`) feeds it the events one by one and carries out the actions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from relit_camera.base.errors import RelitError


@dataclass(frozen=True)
class HealthLimits:
    """How long a pipeline may take, and how often it may fail. Chosen, not measured; see docs/reliability.md.

    Attributes:
        retry_s: pause after a frame that failed; it doubles with each further failure in a row.
        max_backoff_doublings: how often the pause after a failure, and the time until a hanging worker is abandoned,
            double at most.
        hang_timeout_s: a worker that has been at one frame for longer hangs: the fallback is shown.
        abandon_timeout_s: a worker that has been at one frame for longer is abandoned and another started. The time
            doubles with each abandoned worker in a row. What it waited for a processor does not count: another worker
            would wait as well, and open models besides.
        starved_factor: a worker that waits for a processor is abandoned all the same after so many times as long.
        first_frame_factor: the first picture of a worker, and the first after it began to open other models, may take
            so many times as long.
        max_abandoned_workers: abandoned workers hold memory. With so many, no other is started until one of them ends.
        faults_before_restart: after so many failures in a row that are faults in the program (no `RelitError`), the
            worker's own state is suspected, and another is started.
    """

    retry_s: float = 1.0
    max_backoff_doublings: int = 4
    hang_timeout_s: float = 2.0
    abandon_timeout_s: float = 10.0
    starved_factor: int = 6
    first_frame_factor: int = 6
    max_abandoned_workers: int = 3
    faults_before_restart: int = 3


# Events. `at` is in seconds on the clock of the run; `worker` is the number of a worker, counted from 0.


@dataclass(frozen=True)
class FrameArrived:
    """The source gave a frame, while the scene had this revision.

    Attributes:
        paused_s: for how long the supervisor itself did not run since the last frame: the program was stopped, say. The
            worker did not run either.
        starved_s: for how long the worker at work waited for a processor since the last frame.
    """

    at: float
    scene_revision: int
    paused_s: float = 0.0
    starved_s: float = 0.0


@dataclass(frozen=True)
class FrameStarted:
    """A worker took a frame and begins to work on it."""

    worker: int
    at: float


@dataclass(frozen=True)
class ModelsOpening:
    """A worker begins to open models for the frame that it is at: those of another subject or mode, or a matte."""

    worker: int
    at: float


@dataclass(frozen=True)
class FrameFinished:
    """A worker is ready for the next frame; the picture of the last one may still be in the making."""

    worker: int


@dataclass(frozen=True)
class PictureRendered:
    """A worker rendered the picture of the frame that it took at `begun_at`."""

    worker: int
    at: float
    begun_at: float


@dataclass(frozen=True)
class FrameFailed:
    """A worker could not render the frame that it took at `begun_at`, while the scene had this revision."""

    worker: int
    at: float
    begun_at: float
    scene_revision: int
    error: Exception


@dataclass(frozen=True)
class WorkerEnded:
    """The threads of a retired worker have ended."""

    worker: int


@dataclass(frozen=True)
class ReplacementAsked:
    """Another pipeline shall take the place of the one at work: somebody chose another tracker, say."""


Event = (
    ReplacementAsked
    | FrameArrived
    | FrameStarted
    | ModelsOpening
    | FrameFinished
    | PictureRendered
    | FrameFailed
    | WorkerEnded
)


# Actions, to be taken in the order given.


@dataclass(frozen=True)
class StartWorker:
    """Start a worker with a new pipeline; it is the one at work from now on."""

    worker: int


@dataclass(frozen=True)
class RetireWorker:
    """Take no more pictures from the worker at work, and let it end when it can."""

    worker: int


@dataclass(frozen=True)
class SubmitFrame:
    """Give the frame that arrived to the worker at work."""


@dataclass(frozen=True)
class ShowFallback:
    """Show the fallback for the frame that arrived: no picture of it can be expected."""


@dataclass(frozen=True)
class ReportFailure:
    """Say that the pipeline fails, and why."""

    error: Exception


@dataclass(frozen=True)
class ReportHang:
    """Say that the worker at work hangs, or, where it is starved, that it waited for a processor most of the time."""

    worker: int
    starved: bool = False


@dataclass(frozen=True)
class ReportRecovery:
    """Say that the pipeline works again."""


Action = StartWorker | RetireWorker | SubmitFrame | ShowFallback | ReportFailure | ReportHang | ReportRecovery


@dataclass(frozen=True)
class PipelineHealth:
    """What is known of the pipeline.

    Attributes:
        worker: number of the worker at work; None before the first and while none may be started.
        started_workers: how many were started so far; the next one gets this number.
        abandoned: workers that were retired and have not ended.
        busy_since: when the worker at work took the frame that it is at, or gave the picture of the one before, if that
            was later; None while it waits for a frame.
        paused_s: for how long of that time the supervisor itself did not run.
        starved_s: for how long of that time the worker waited for a processor.
        opening_at: when the worker at work last began to open models.
        has_rendered: whether it has rendered a picture of a frame that it took after that.
        failures: frames that failed since the last picture.
        hangs: workers that were abandoned for hanging since the last picture.
        hang_reported: whether a hang was reported since the last picture.
        restart_due: whether the worker at work is to be replaced when the pause after a failure is over.
        retry_at: when the pause after the last failure is over.
        failed_frame_at: when the last frame that failed was taken.
        failed_revision: the scene's revision at the last failure: under another scene it is tried again at once.
    """

    worker: int | None = None
    started_workers: int = 0
    abandoned: frozenset[int] = frozenset()
    busy_since: float | None = None
    paused_s: float = 0.0
    starved_s: float = 0.0
    opening_at: float = 0.0
    has_rendered: bool = False
    failures: int = 0
    hangs: int = 0
    hang_reported: bool = False
    restart_due: bool = False
    retry_at: float = 0.0
    failed_frame_at: float = 0.0
    failed_revision: int | None = None

    @property
    def in_trouble(self) -> bool:
        """Whether a failure or a hang was reported, and no recovery since."""
        return self.failures > 0 or self.hang_reported


Transition = tuple[PipelineHealth, tuple[Action, ...]]


def next_health(health: PipelineHealth, event: Event, limits: HealthLimits) -> Transition:
    """The health after an event, and the actions to take. What a retired worker does late changes nothing."""
    if isinstance(event, FrameArrived):
        return _after_arrival(health, event, limits)
    if isinstance(event, ReplacementAsked):
        health = replace(health, retry_at=0.0)  # what failed may work now
        return (health, ()) if health.worker is None else _retired(health)
    if isinstance(event, WorkerEnded):
        return replace(health, abandoned=health.abandoned - {event.worker}), ()
    if event.worker != health.worker:
        return health, ()
    if isinstance(event, FrameStarted):
        return replace(health, busy_since=event.at, paused_s=0.0, starved_s=0.0), ()
    if isinstance(event, ModelsOpening):
        return replace(health, opening_at=event.at, has_rendered=False), ()
    if isinstance(event, FrameFinished):
        return replace(health, busy_since=None), ()
    if isinstance(event, PictureRendered):
        return _after_picture(health, event)
    return _after_failure(health, event, limits)


def _after_arrival(health: PipelineHealth, event: FrameArrived, limits: HealthLimits) -> Transition:
    actions: tuple[Action, ...] = ()
    if health.worker is None:
        if len(health.abandoned) >= limits.max_abandoned_workers:
            return health, (ShowFallback(),)
        number = health.started_workers
        health = replace(health, worker=number, started_workers=number + 1, has_rendered=False, busy_since=None)
        actions = (StartWorker(number),)
    at_frame_s = 0.0 if health.busy_since is None else event.at - health.busy_since  # it may have begun after the pause
    paused_s = min(health.paused_s + event.paused_s, at_frame_s)
    starved_s = min(health.starved_s + event.starved_s, at_frame_s)
    health = replace(health, paused_s=paused_s, starved_s=starved_s)
    busy_s = at_frame_s - paused_s
    if busy_s > limits.hang_timeout_s:
        return _after_hang(health, busy_s, limits)
    if health.failures and event.at < health.retry_at and event.scene_revision == health.failed_revision:
        return health, (*actions, ShowFallback())
    if health.restart_due:
        health, retired = _retired(health)
        return health, (*actions, *retired, ShowFallback())
    shown: tuple[Action, ...] = (ShowFallback(),) if health.in_trouble else ()
    return health, (*actions, SubmitFrame(), *shown)


def _after_hang(health: PipelineHealth, busy_s: float, limits: HealthLimits) -> Transition:
    worker = health.worker
    assert worker is not None
    actions: tuple[Action, ...] = ()
    # Opening models takes seconds: a worker that has rendered nothing since is not reported so soon.
    if not health.hang_reported and (health.has_rendered or busy_s > limits.abandon_timeout_s):
        starved = health.starved_s > busy_s / 2
        health, actions = replace(health, hang_reported=True), (ReportHang(worker, starved),)
    patience_s = limits.abandon_timeout_s * _backoff(health.hangs, limits)
    if not health.has_rendered:
        patience_s *= limits.first_frame_factor
    working_s = max(busy_s - health.starved_s, busy_s / limits.starved_factor)
    if working_s > patience_s:
        health, retired = _retired(replace(health, hangs=health.hangs + 1))
        actions += retired
    return health, (*actions, ShowFallback())


def _after_picture(health: PipelineHealth, event: PictureRendered) -> Transition:
    # One frame is rendered while the next is begun: the picture may be of a frame before the one that failed, or before
    # the one for which models are opened.
    health = replace(health, has_rendered=health.has_rendered or event.begun_at >= health.opening_at)
    if health.has_rendered and health.busy_since is not None:
        # A worker that gives a picture works: its next frame, begun meanwhile, has had to wait for that.
        since = max(health.busy_since, event.at)
        health = replace(health, busy_since=since, paused_s=0.0, starved_s=0.0)
    if health.failures and event.begun_at < health.failed_frame_at:
        return health, ()
    actions = (ReportRecovery(),) if health.in_trouble else ()
    return replace(health, failures=0, hangs=0, hang_reported=False, restart_due=False), actions


def _after_failure(health: PipelineHealth, event: FrameFailed, limits: HealthLimits) -> Transition:
    failures = health.failures + 1
    is_fault = not isinstance(event.error, RelitError)
    failed = replace(
        health,
        failures=failures,
        retry_at=event.at + limits.retry_s * _backoff(health.failures, limits),
        failed_frame_at=event.begun_at,
        failed_revision=event.scene_revision,
        restart_due=health.restart_due or (is_fault and failures % limits.faults_before_restart == 0),
    )
    return failed, (ReportFailure(event.error),)


def _retired(health: PipelineHealth) -> tuple[PipelineHealth, tuple[Action, ...]]:
    """Without the worker at work, which is abandoned."""
    assert health.worker is not None
    abandoned = health.abandoned | {health.worker}
    retired = replace(health, worker=None, busy_since=None, restart_due=False, abandoned=abandoned)
    return retired, (RetireWorker(health.worker),)


def _backoff(count: int, limits: HealthLimits) -> int:
    return int(2 ** min(count, limits.max_backoff_doublings))
