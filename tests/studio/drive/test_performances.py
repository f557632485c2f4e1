"""What the performances do, and that they are eased."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from relit_camera.base.errors import NotFoundError
from relit_studio.drive.performance import FPS, ActorState, Performance, frame_times
from relit_studio.drive.performances.performance_catalog import PERFORMANCES, find_performance
from relit_studio.people.face.expressions import NEUTRAL


def actor_states(name: str) -> list[ActorState]:
    performance = find_performance(name)
    return [performance.state_at(time_s) for time_s in frame_times(performance.frames)]


def angles(name: str) -> np.ndarray:
    """Yaw, pitch and roll of every frame, (3, frames)."""
    return np.array([state.posture.angles for state in actor_states(name)]).T


@pytest.mark.parametrize("performance", PERFORMANCES.values(), ids=list(PERFORMANCES))
def test_a_performance_is_eased_and_begins_and_ends_at_rest(performance: Performance) -> None:
    name = performance.name
    assert np.abs(np.diff(angles(name), axis=1)).max() < 4.5  # degrees a frame
    shifts = np.array([state.shift_cm for state in actor_states(name)])
    assert np.linalg.norm(np.diff(shifts, axis=0), axis=1).max() < 4.0  # centimeters a frame
    weights = [weight for state in actor_states(name) for weight in state.posture.expression.values()]
    assert min(weights) >= 0
    assert max(weights) <= 1.2
    lids = [state.posture.expression["eyeBlink_L"] for state in actor_states(name)]
    assert sum(before < 0.9 <= after for before, after in pairwise(lids)) >= 3
    for end in (performance.state_at(0), performance.state_at(performance.frames / FPS)):
        np.testing.assert_allclose(end.posture.angles, 0, atol=1e-9)
        assert end.shift_cm == (0, 0, 0)
        assert {key: weight for key, weight in end.posture.expression.items() if weight} == NEUTRAL


def test_talk_is_six_seconds_that_turn_to_both_sides() -> None:
    assert find_performance("talk").frames == 6 * FPS
    yaw, pitch, roll = angles("talk")
    assert 25 < yaw.max() < 30
    assert -30 < yaw.min() < -25
    assert np.abs([pitch, roll]).max() < 12


def test_turn_reaches_what_a_tracker_is_asked_to_follow_one_axis_at_a_time() -> None:
    yaw, pitch, _ = angles("turn")
    for course, reach in ((yaw, 45), (pitch, 20)):
        assert reach - 0.6 < course.max() < reach + 0.6
        assert -reach - 0.6 < course.min() < -reach + 0.6
    assert np.minimum(np.abs(yaw), np.abs(pitch)).max() < 1
    assert np.abs(np.diff(yaw)).max() * FPS < 45  # degrees a second


def test_hands_come_one_after_the_other() -> None:
    gestures = [state.gesture for state in actor_states("hands") if state.gesture]
    assert len(gestures) == len(actor_states("hands"))
    mug, hand = (np.array([getattr(gesture, name) for gesture in gestures]) for name in ("mug", "hand"))
    assert mug.max() == hand.max() == 1
    assert not np.logical_and(mug, hand).any()
    tilt = np.array([gesture.tilt_deg for gesture in gestures])
    assert tilt[mug == 1].max() > 30
    assert tilt[mug < 0.5].max() < 10


def test_only_away_leaves_its_place_and_only_hands_has_hands() -> None:
    for name, performance in PERFORMANCES.items():
        left = max(np.linalg.norm(state.shift_cm) for state in actor_states(name))
        assert (left > 60) == (name == "away")
        assert (left == 0) == (name != "away")
        assert performance.handles == (name == "hands")


def test_an_unknown_performance_is_told_with_those_that_are_known() -> None:
    with pytest.raises(NotFoundError) as caught:
        find_performance("dance")
    assert "talk, turn, hands, away" in str(caught.value.cure)
