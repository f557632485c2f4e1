"""Says what to do where the computer does not keep up: once it has not for some seconds, until it has for some."""

from __future__ import annotations

from dataclasses import dataclass, replace

from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.status.setup_status import SpeedAdvice

SMALLER_SIZES = ((1280, 720), (960, 540), (640, 360), (480, 270))
"""Sizes that are advised; the next one below the present."""


@dataclass(frozen=True)
class SpeedLimits:
    """When the computer counts as not keeping up.

    Attributes:
        enough: part of the frames that must become pictures.
        after_s: for how long it must be so before anything is said, and be better before it is taken back.
        gap_s: a longer time without a look begins anew.
    """

    enough: float = 0.8
    after_s: float = 5.0
    gap_s: float = 10.0


DEFAULT_LIMITS = SpeedLimits()


@dataclass(frozen=True)
class SpeedState:
    """What is known of the speed.

    Attributes:
        behind: whether it is said that the computer does not keep up.
        other_since: since when the opposite is seen; None while it is not.
        seen_at: time of the last look.
    """

    behind: bool = False
    other_since: float | None = None
    seen_at: float = 0.0


def next_speed(
    state: SpeedState, now: float, expected_fps: float, new_fps: float, limits: SpeedLimits = DEFAULT_LIMITS
) -> SpeedState:
    """The state after a look at `now` seconds on a clock.

    Args:
        state: before.
        now: time of the look.
        expected_fps: pictures a second that there could be; 0 while none are expected.
        new_fps: pictures a second that there are.
        limits: how few pictures a second are too few, and for how long.
    """
    behind = new_fps < limits.enough * expected_fps
    if behind is state.behind:
        return replace(state, other_since=None, seen_at=now)
    since = state.other_since
    if since is None or now - state.seen_at > limits.gap_s:
        since = now
    if now - since >= limits.after_s:
        return SpeedState(behind, None, now)
    return replace(state, other_since=since, seen_at=now)


def smaller_size(size: tuple[int, int]) -> tuple[int, int]:
    """The next smaller size (width, height) that is advised; the same where there is none."""
    return next((each for each in SMALLER_SIZES if each[0] * each[1] < size[0] * size[1]), size)


def slow_cure(size: tuple[int, int]) -> str:
    """What to do where pictures of `size` (width, height) are too much for the computer."""
    width, height = smaller_size(size)
    if (width, height) == size:
        return "close other programs: no smaller size would help"
    return f"try {width}x{height}, or close other programs"


def speed_advice(size: tuple[int, int], expected_fps: float, new_fps: float) -> SpeedAdvice:
    """What to do where pictures of `size` (width, height) come too slowly."""
    what = f"the computer makes {new_fps:.0f} of {expected_fps:.0f} pictures a second"
    return SpeedAdvice(what, slow_cure(size), *smaller_size(size))


def reduced_quality(latency_s: float, size: tuple[int, int]) -> Degradation:
    """What the status says where pictures of `size` come `latency_s` seconds late, and are given less detail."""
    return Degradation(
        code=DegradationCode.REDUCED_QUALITY,
        what="pictures have less detail, or are fewer",
        why=f"the computer is busy: they come {1e3 * latency_s:.0f} ms late",
        cure=f"{slow_cure(size)}; full quality comes back by itself",
    )
