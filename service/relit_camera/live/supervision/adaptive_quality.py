"""How much detail a picture is given while the computer is busy: a state machine without threads or clock.

Where pictures come late, each costs less in steps; where there is time again, the steps are taken back. So latency and
not the queue grows. `next_quality` takes the state and how late a picture was, and gives the state after it. Whoever
owns the state (`pipeline_supervisor.PipelineSupervisor`) tells the pipeline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from relit_camera.live.render_quality import QUALITY_LEVELS, RenderQuality


@dataclass(frozen=True)
class QualityLimits:
    """When quality is lowered and raised. `python -m tests.overload` shows what comes of it (docs/performance.md).

    Attributes:
        late_s: mean latency of the last pictures above which quality is lowered.
        early_s: mean latency below which it is raised: far enough below `late_s` that a level up stays below that.
        probe_after_s: how long pictures must have been bearable, if not early, until a level up is tried all the same,
            as on a slow computer they may never be early.
        idle_s: mean latency below which the load has surely gone, and raising is not delayed.
        lower_after_s: how long pictures must be late, and how long a level is given to show what it saves.
        raise_after_s: how long pictures must be early. All levels up within two seconds.
        max_raise_delay_s: each time a raised level proves too costly the wait before the next try doubles, up to this.
        last_level_s: how long pictures must be late at the last level until one up is tried all the same.
        smoothing_s: time constant of the mean.
    """

    late_s: float = 0.080
    early_s: float = 0.055
    probe_after_s: float = 2.0
    idle_s: float = 0.040
    lower_after_s: float = 0.4
    raise_after_s: float = 0.35
    max_raise_delay_s: float = 16.0
    last_level_s: float = 20.0
    smoothing_s: float = 0.15


@dataclass(frozen=True)
class QualityState:
    """What is known of the load.

    Attributes:
        level: index into `QUALITY_LEVELS`.
        latency_s: smoothed latency of the pictures; None before the first.
        seen_at: when the last picture was rendered, in seconds on the clock.
        since: since when pictures have been late or early without a break; None while they are neither.
        late: which of the two.
        bearable_since: since when they have not been late for `lower_after_s` without a break; None while they are, and
            after a change of level or a pause.
        raised_at: when quality was last raised; None when it was not, or when that has proved right.
        raise_delay_s: how long pictures must be early or bearable before quality is raised.
    """

    level: int = 0
    latency_s: float | None = None
    seen_at: float = 0.0
    since: float | None = None
    late: bool = False
    bearable_since: float | None = None
    raised_at: float | None = None
    raise_delay_s: float = 0.0

    @property
    def quality(self) -> RenderQuality:
        """What the next picture may cost."""
        return QUALITY_LEVELS[self.level]


def next_quality(state: QualityState, rendered_at: float, latency_s: float, limits: QualityLimits) -> QualityState:
    """The state after a picture.

    Args:
        state: before it.
        rendered_at: when it was rendered, in seconds on the clock.
        latency_s: from the arrival of its frame till then.
        limits: latencies at which pictures become cheaper and better again.
    """
    state = _with_latency(state, rendered_at, latency_s, limits)
    latency = state.latency_s or 0.0
    late, early = latency > limits.late_s, latency < limits.early_s
    if state.bearable_since is None and not late:
        state = replace(state, bearable_since=rendered_at)
    if not late and not early:
        return _probed(replace(state, since=None), rendered_at, limits)
    since = rendered_at if state.since is None or late is not state.late else state.since
    state, lasted = replace(state, since=since, late=late), rendered_at - since
    if late and lasted >= limits.lower_after_s:
        state = replace(state, bearable_since=None)
        if state.level + 1 < len(QUALITY_LEVELS):
            return _lowered(state, rendered_at, limits)
        if lasted >= limits.last_level_s:  # perhaps it is this level that is slow, and not the load that is large
            return _raised(state, rendered_at)
        # What was tried before says nothing of a load that lasts.
        return state if lasted < limits.probe_after_s else replace(state, raise_delay_s=0.0)
    idle = latency < limits.idle_s
    delay = limits.raise_after_s if idle else max(limits.raise_after_s, state.raise_delay_s)
    if early and lasted >= delay and state.level > 0:
        return _raised(state, rendered_at)
    return state


def _probed(state: QualityState, now: float, limits: QualityLimits) -> QualityState:
    """One level up, where pictures have not been late for so long; if that proves too costly, later the next time."""
    delay = max(limits.probe_after_s, state.raise_delay_s)
    if state.raised_at is not None and now - state.raised_at >= 2 * (delay + limits.lower_after_s):
        state = replace(state, raised_at=None, raise_delay_s=0.0)  # the level has proved right
    if state.level == 0 or state.bearable_since is None or now - state.bearable_since < delay:
        return state
    return replace(_raised(state, now), raise_delay_s=delay)


def _raised(state: QualityState, now: float) -> QualityState:
    return replace(state, level=state.level - 1, since=None, bearable_since=None, raised_at=now)


def _with_latency(state: QualityState, now: float, latency_s: float, limits: QualityLimits) -> QualityState:
    captured_at = now - latency_s
    latency_s = min(latency_s, 2 * limits.late_s)  # one that is very late, while models are opened, is still but one
    if state.latency_s is None or now < state.seen_at:
        return replace(state, latency_s=latency_s, seen_at=now)
    mean_s, weight = state.latency_s, min(1.0, (now - state.seen_at) / limits.smoothing_s)
    # Nothing is known of a pause. Between pictures that take long there is none: the frame of the next has waited.
    if captured_at - state.seen_at > limits.lower_after_s:
        state = replace(state, since=None, bearable_since=None)
    return replace(state, latency_s=mean_s + weight * (latency_s - mean_s), seen_at=now)


def _lowered(state: QualityState, now: float, limits: QualityLimits) -> QualityState:
    """One level down. Where that level was left only lately, the next try waits twice as long."""
    delay = state.raise_delay_s or limits.raise_after_s
    tried = state.raised_at is not None and now - state.raised_at < 2 * delay + 2 * limits.lower_after_s
    delay = min(2 * delay, limits.max_raise_delay_s) if tried else limits.raise_after_s
    return replace(state, level=state.level + 1, since=None, bearable_since=None, raised_at=None, raise_delay_s=delay)
