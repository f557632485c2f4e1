from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.rotations import angles_from_rotation
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import unproject
from relit_camera.face.motion.neutral_face import NeutralFace, NeutralFaceFinder
from tests.face.faces import RATE, SCHEME, SIZE, face, open_mouth, shut_eyes


def feed(finder: NeutralFaceFinder, states: list[FaceState], start: int = 0) -> tuple[NeutralFace | None, int]:
    """The neutral face and the number of states it took, or None."""
    for index, state in enumerate(states, start):
        assert state.pose is not None
        points = unproject(state.landmarks, state.pose, SCHEME, SIZE)
        found = finder.add(state, points, index / RATE)
        if found:
            return found, index + 1
    return None, start + len(states)


def mouth_gap(neutral: NeutralFace) -> float:
    upper, lower = SCHEME.lip_gap
    return float((neutral.points[list(upper), 1] - neutral.points[list(lower), 1]).mean())


CLOSED_GAP = mouth_gap(NeutralFace(SCHEME.canonical, face().pose))  # type: ignore[arg-type]


def test_a_calm_face_is_its_own_neutral_after_a_second() -> None:
    neutral, taken = feed(NeutralFaceFinder(), [face(3, 2, 1, at=(1, 2, -45))] * 60)
    assert neutral is not None
    assert taken == pytest.approx(RATE, abs=2)
    np.testing.assert_allclose(neutral.points, SCHEME.canonical, atol=1e-3)
    np.testing.assert_allclose(angles_from_rotation(neutral.pose.rotation), (3, 2, 1), atol=1e-6)
    np.testing.assert_allclose(neutral.pose.translation, (1, 2, -45))


def test_speech_and_blinks_do_not_get_into_it() -> None:
    talking = [face(points=open_mouth(SCHEME, gap)) for gap in (1.0, 1.5, 0.0, 0.8)] * 10
    blinking = [face(points=shut_eyes(SCHEME))] * 4
    neutral, _ = feed(NeutralFaceFinder(), talking[:8] + blinking + talking)
    assert neutral is not None
    assert mouth_gap(neutral) == pytest.approx(CLOSED_GAP, abs=0.05)
    lids = SCHEME.right_eye.gap
    assert (neutral.points[list(lids[0]), 1] > neutral.points[list(lids[1]), 1] + 0.3).all()


def test_an_outlier_does_not_move_it() -> None:
    wild = face(15, -15, 10, at=(9, 9, -80))
    neutral, _ = feed(NeutralFaceFinder(), [face(), face(), wild] * 20)
    assert neutral is not None
    np.testing.assert_allclose(angles_from_rotation(neutral.pose.rotation), 0, atol=0.5)
    np.testing.assert_allclose(neutral.pose.translation, (0, 0, -50), atol=0.5)


@pytest.mark.parametrize("angles", [(12, 0, 0), (0, 0, 12), (0, 0, -12)], ids=["turned", "tilted right", "tilted left"])
def test_the_straightest_frames_are_taken(angles: tuple[float, float, float]) -> None:
    neutral, _ = feed(NeutralFaceFinder(), [face(*angles)] * 18 + [face()] * 15)
    assert neutral is not None
    np.testing.assert_allclose(angles_from_rotation(neutral.pose.rotation), 0, atol=0.5)


def test_uncertain_and_lost_states_are_never_taken() -> None:
    assert feed(NeutralFaceFinder(), [face(status=FaceStatus.UNCERTAIN)] * 200)[0] is None
    assert feed(NeutralFaceFinder(any_pose=True), [face(status=FaceStatus.UNCERTAIN)] * 200)[0] is None


def test_a_turned_head_is_waited_for_but_not_forever() -> None:
    frontal_again, _ = feed(NeutralFaceFinder(), [face(35)] * 45 + [face(2)] * 45)
    assert frontal_again is not None
    assert angles_from_rotation(frontal_again.pose.rotation).yaw == pytest.approx(2)
    always_aside, taken = feed(NeutralFaceFinder(), [face(35)] * 300)
    assert always_aside is not None
    assert angles_from_rotation(always_aside.pose.rotation).yaw == pytest.approx(35)
    assert taken / RATE == pytest.approx(4.0, abs=0.2)


def test_as_is_takes_the_next_ten_frames_however_they_look() -> None:
    neutral, taken = feed(NeutralFaceFinder(any_pose=True), [face(35)] * 30)
    assert neutral is not None
    assert taken == 10
    assert angles_from_rotation(neutral.pose.rotation).yaw == pytest.approx(35)
