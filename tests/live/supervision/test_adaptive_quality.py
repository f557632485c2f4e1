"""How quality follows the load: a simulated machine whose latency grows with load and falls with each level."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from relit_camera.live.render_quality import QUALITY_LEVELS
from relit_camera.live.supervision.adaptive_quality import QualityLimits, QualityState, next_quality

LIMITS = QualityLimits()
SAVED = (1.0, 0.9, 0.7, 0.55, 0.35)
"""Latency at each level, relative to full quality."""
FRAME_S = 1 / 30


def simulate(full_latency_s: Callable[[float], float], seconds: float) -> list[tuple[float, int]]:
    """(time, level) of each picture, where full quality has a latency of `full_latency_s(time)`."""
    state, levels, now = QualityState(), [], 0.0
    while now < seconds:
        latency = full_latency_s(now) * SAVED[state.level]
        now += max(FRAME_S, latency / 2)  # two frames are at work at once
        state = next_quality(state, now, latency, LIMITS)
        levels.append((now, state.level))
    return levels


def level_at(levels: list[tuple[float, int]], time_s: float) -> int:
    return next(level for at, level in reversed(levels) if at <= time_s)


def changes(levels: list[tuple[float, int]], after_s: float) -> int:
    late = [level for at, level in levels if at > after_s]
    return sum(a != b for a, b in pairwise(late))


def test_there_is_no_cheaper_level_than_the_last_and_each_is_cheaper() -> None:
    for cheaper, dearer in zip(QUALITY_LEVELS[1:], QUALITY_LEVELS, strict=False):
        assert cheaper.relight_every >= dearer.relight_every
        assert cheaper.half_size >= dearer.half_size
        assert cheaper.track_every >= dearer.track_every
        assert cheaper.live_track_every >= dearer.live_track_every
        assert cheaper.render_every >= dearer.render_every
        assert cheaper != dearer


def test_a_machine_with_time_keeps_full_quality() -> None:
    assert {level for _, level in simulate(lambda now: 0.035, 60)} == {0}


def test_one_late_picture_changes_nothing() -> None:
    assert {level for _, level in simulate(lambda now: 0.3 if 5 < now < 5.05 else 0.035, 10)} == {0}


def test_overload_lowers_quality_until_pictures_are_in_time() -> None:
    levels = simulate(lambda now: 0.105 if now > 1 else 0.035, 20)
    assert level_at(levels, 3) == 2
    assert 0.105 * SAVED[2] < LIMITS.late_s


def test_overload_beyond_all_levels_ends_at_the_cheapest_within_two_seconds() -> None:
    levels = simulate(lambda now: 0.3 if now > 1 else 0.035, 20)
    assert level_at(levels, 3.5) == len(QUALITY_LEVELS) - 1
    assert changes(levels, 4) == 0


def test_at_the_last_level_of_an_overload_another_one_is_tried_seldom_and_for_a_moment() -> None:
    levels = simulate(lambda now: 0.3 if now > 1 else 0.035, 120)
    assert 0 < changes(levels, 4) <= 2 * 120 / LIMITS.last_level_s
    assert sum(level < len(QUALITY_LEVELS) - 1 for at, level in levels if at > 4) < 0.05 * len(levels)


def test_pictures_that_come_once_a_second_are_made_cheaper_too() -> None:
    """Each frame has waited while the picture before it was made: there is no pause between them."""
    levels = simulate(lambda now: 2.0 if now > 1 else 0.035, 20)
    assert level_at(levels, 8) == len(QUALITY_LEVELS) - 1


def test_full_quality_is_back_two_seconds_after_the_load_has_gone() -> None:
    levels = simulate(lambda now: 0.3 if 1 < now < 30 else 0.035, 40)
    assert level_at(levels, 29) == len(QUALITY_LEVELS) - 1
    assert level_at(levels, 32.0) == 0


def test_a_slow_computer_that_is_never_early_comes_back_to_full_quality() -> None:
    """Its pictures take 65 ms by themselves; at the last level, which renders fewer, each takes even longer."""

    def latency(level: int, now: float) -> float:
        return 0.2 if 1 < now < 15 else (0.065, 0.065, 0.06, 0.06, 0.073)[level]

    state, now, levels = QualityState(), 0.0, []
    while now < 60:
        now += FRAME_S
        state = next_quality(state, now, latency(state.level, now), LIMITS)
        levels.append((now, state.level))
    assert level_at(levels, 14) == len(QUALITY_LEVELS) - 1
    assert level_at(levels, 15 + 5 * LIMITS.probe_after_s) == 0
    assert changes(levels, 15 + 5 * LIMITS.probe_after_s) == 0


def test_a_last_level_that_is_late_by_itself_is_left() -> None:
    """It renders fewer pictures, each of which may take longer than one of the levels above."""
    state, now, levels = QualityState(), 0.0, []
    while now < 60:
        now += FRAME_S
        latency = 0.2 if 1 < now < 10 else 0.083 if state.level == len(QUALITY_LEVELS) - 1 else 0.065
        state = next_quality(state, now, latency, LIMITS)
        levels.append((now, state.level))
    assert level_at(levels, 9) == len(QUALITY_LEVELS) - 1
    assert level_at(levels, 10 + LIMITS.last_level_s + 5 * LIMITS.probe_after_s) == 0


def test_a_level_that_becomes_late_only_after_a_while_is_tried_less_and_less_often_too() -> None:
    state, now, raised, reached = QualityState(level=1), 0.0, list[float](), 0.0
    while now < 240:
        now += FRAME_S
        before = state.level
        latency = 0.1 if state.level == 0 and now - reached > 2.3 else 0.07
        state = next_quality(state, now, latency, LIMITS)
        if state.level < before:
            raised.append(now)
            reached = now
    assert sum(at > 120 for at in raised) <= 8


def test_what_was_tried_under_a_load_does_not_delay_the_way_back_after_a_larger_one() -> None:
    """Level 1 is bearable and level 0 late, so the next try waits for long; then all are late; then none is."""
    state, now, levels = QualityState(), 0.0, []
    while now < 150:
        now += FRAME_S
        latency = 0.095 if state.level == 0 else 0.07
        state = next_quality(state, now, latency if now < 100 else 0.2 if now < 110 else 0.065, LIMITS)
        levels.append((now, state.level))
    assert level_at(levels, 109) == len(QUALITY_LEVELS) - 1
    assert level_at(levels, 110 + 5 * LIMITS.probe_after_s) == 0


def test_a_level_that_is_bearable_is_left_less_and_less_often_where_the_one_above_is_late() -> None:
    levels = simulate(lambda now: 0.105 if now > 1 else 0.035, 120)
    assert {level for at, level in levels if at > 3} == {1, 2}
    assert sum(level == 1 for at, level in levels if at > 60) * FRAME_S < 0.05 * 60


def test_a_level_that_proves_too_costly_is_tried_less_and_less_often() -> None:
    # Level 1 is early and level 0 is late: without the growing wait it would go up and down each second.
    state, now, raised = QualityState(), 0.0, []
    while now < 120:
        now += FRAME_S
        before = state.level
        state = next_quality(state, now, 0.095 if state.level == 0 else 0.05, LIMITS)
        if state.level < before:
            raised.append(now)
    waits = [round(b - a, 3) for a, b in pairwise(raised)]
    assert waits == sorted(waits)
    assert waits[-1] >= LIMITS.max_raise_delay_s
    assert len(raised) < 15


@given(st.lists(st.floats(0.001, 3.0), min_size=1, max_size=400))
def test_any_latencies_keep_the_level_in_range_and_change_it_by_one(latencies: list[float]) -> None:
    state, now = QualityState(), 0.0
    for latency in latencies:
        now += FRAME_S
        after = next_quality(state, now, latency, LIMITS)
        assert 0 <= after.level < len(QUALITY_LEVELS)
        assert abs(after.level - state.level) <= 1
        state = after


def test_one_late_picture_after_a_pause_changes_nothing() -> None:
    state = next_quality(QualityState(), 1.0, 0.2, LIMITS)
    assert next_quality(state, 60.0, 0.2, LIMITS).level == 0


def test_a_clock_that_jumps_back_begins_anew() -> None:
    state = next_quality(QualityState(), 100.0, 0.2, LIMITS)
    assert next_quality(state, 1.0, 0.03, LIMITS).latency_s == 0.03
