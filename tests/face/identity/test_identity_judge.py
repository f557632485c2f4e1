"""Judging by several looks, in virtual time."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.face.identity.face_embedder import Embedding
from relit_camera.face.identity.identity_judge import (
    IdentityJudge,
    JudgeTunables,
    PersonTrack,
    Verdict,
    median_distance,
)

LIMITS = JudgeTunables()
REFERENCE = np.full(128, 0.1, np.float32)
NEAR, FAR = LIMITS.distance - LIMITS.margin - 0.01, LIMITS.distance + LIMITS.margin + 0.01
A_BIT_NEAR, A_BIT_FAR = LIMITS.distance - 0.01, LIMITS.distance + 0.01


def look(distance: float, direction: int = 0) -> Embedding:
    """An embedding so far from the reference."""
    embedding = REFERENCE.copy()
    embedding[direction] += distance
    return embedding


def watched(*distances: float, track: PersonTrack | None = None, since_s: float = 0.0) -> PersonTrack:
    """A track with looks at these distances, half a second apart."""
    track = track or PersonTrack()
    for index, distance in enumerate(distances):
        track.add(look(distance, index), since_s + 0.5 * index)
    return track


def judge_of(track: PersonTrack) -> IdentityJudge:
    return IdentityJudge(track, REFERENCE)


def verdict(*distances: float) -> Verdict:
    return judge_of(watched(*distances)).judge()


def test_nothing_is_known_before_there_are_enough_looks() -> None:
    assert verdict() is Verdict.UNKNOWN
    assert verdict(*[0.0] * (LIMITS.least_looks - 1)) is Verdict.UNKNOWN
    assert verdict(*[2.0] * (LIMITS.least_looks - 1)) is Verdict.UNKNOWN


def test_the_person_and_another() -> None:
    assert verdict(NEAR, NEAR, NEAR) is Verdict.SAME
    assert verdict(FAR, FAR, FAR) is Verdict.OTHER
    assert verdict(*[NEAR] * 5) is Verdict.SAME


def test_single_looks_do_not_mislead() -> None:
    assert verdict(NEAR, 2.0, NEAR, 2.0, NEAR) is Verdict.SAME
    assert verdict(FAR, 0.0, FAR, 0.0, FAR) is Verdict.OTHER


def test_only_the_last_looks_count() -> None:
    assert verdict(*[FAR] * 9, *[NEAR] * 3) is Verdict.SAME
    assert verdict(*[FAR] * 9, *[NEAR] * 2) is Verdict.OTHER


@pytest.mark.parametrize("distance", [A_BIT_NEAR, A_BIT_FAR])
def test_near_the_threshold_the_verdict_stays_what_it_was(distance: float) -> None:
    assert verdict(*[distance] * 5) is Verdict.UNKNOWN
    for first, expected in ((NEAR, Verdict.SAME), (FAR, Verdict.OTHER)):
        track = watched(*[first] * 5)
        judge = judge_of(track)
        assert judge.judge() is expected
        watched(*[distance] * 5, track=track, since_s=2.5)
        assert judge.judge() is expected


def test_a_verdict_changes_where_the_looks_do() -> None:
    track = watched(*[NEAR] * 5)
    judge = judge_of(track)
    assert judge.judge() is Verdict.SAME
    watched(*[FAR] * 3, track=track, since_s=2.5)
    assert judge.judge() is Verdict.OTHER
    watched(*[NEAR] * 3, track=track, since_s=4.0)
    assert judge.judge() is Verdict.SAME


def test_a_face_that_was_lost_is_judged_anew() -> None:
    track = watched(*[NEAR] * 5)
    judge = judge_of(track)
    assert judge.judge() is Verdict.SAME
    track.found(2.0 + LIMITS.gap_s)
    assert judge.judge() is Verdict.SAME
    track.found(2.1 + 2 * LIMITS.gap_s)
    assert track.looks == ()
    assert judge.judge() is Verdict.UNKNOWN
    watched(*[A_BIT_NEAR] * 5, track=track, since_s=2.2 + 2 * LIMITS.gap_s)
    assert judge.judge() is Verdict.UNKNOWN  # near the threshold, and nothing was known


def test_a_former_verdict_does_not_outlive_a_gap_in_which_nobody_asked() -> None:
    track = watched(*[NEAR] * 5)
    judge = judge_of(track)
    assert judge.judge() is Verdict.SAME
    watched(*[A_BIT_NEAR] * 5, track=track, since_s=10.0)
    assert judge.judge() is Verdict.UNKNOWN


def test_a_film_that_begins_anew_is_another_track() -> None:
    track = watched(*[NEAR] * 5, since_s=100.0)
    track.found(0.0)
    assert track.looks == ()
    assert track.is_due(0.0)


def test_two_judges_of_one_track() -> None:
    track = watched(*[NEAR] * 5)
    assert judge_of(track).judge() is Verdict.SAME
    assert IdentityJudge(track, look(2.0, 100)).judge() is Verdict.OTHER


def test_looks_are_frequent_at_first_and_rare_later() -> None:
    track, times = PersonTrack(), []
    for frame in range(int(4.5 * 100)):
        time_s = frame / 100
        track.found(time_s)
        if track.is_due(time_s):
            track.add(look(0.0), time_s)
            times.append(time_s)
    steps = np.diff(times)
    np.testing.assert_allclose(steps[: LIMITS.looks - 1], LIMITS.first_interval_s, atol=0.011)
    np.testing.assert_allclose(steps[LIMITS.looks - 1 :], LIMITS.interval_s, atol=0.011)
    assert len(times) == LIMITS.looks + 3


def test_a_look_is_due_at_once_where_a_face_comes_back() -> None:
    track = watched(*[NEAR] * 5)
    assert not track.is_due(2.1)
    track.found(2.1)
    track.found(4.0)
    assert track.is_due(4.0)


def test_a_face_that_is_found_now_and_then_is_the_same() -> None:
    track = watched(NEAR)
    for time_s in np.arange(0.0, 10.0, LIMITS.gap_s):
        track.found(float(time_s))
    assert len(track.looks) == 1


def test_median_distance() -> None:
    assert median_distance([look(0.3), look(0.9, 1), look(0.5, 2)], REFERENCE) == pytest.approx(0.5)
