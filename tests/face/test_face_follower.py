from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.errors import NotFoundError, TrackError
from relit_camera.base.rotations import angles_from_rotation, rotation_from_angles
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.motion.face_follower import FaceFollower, FaceMotion
from tests.face.faces import RATE, SCHEME, SIZE, face, open_mouth, shut_eyes

SETTLED = 90
"""Frames after which a follower has its neutral face and has eased into it."""


class Player:
    """Feeds a follower at a steady frame rate."""

    def __init__(self, **settle: float) -> None:
        self.follower = FaceFollower(SCHEME.name)
        self.index = 0
        self.play([face(**settle)] * SETTLED)  # type: ignore[arg-type]

    def play(self, states: list[FaceState]) -> list[FaceMotion]:
        motions = []
        for state in states:
            motions.append(self.follower.follow(state, SIZE, self.index / RATE))
            self.index += 1
        return motions


def yaws(motions: list[FaceMotion]) -> np.ndarray:
    return np.array([motion.angles.yaw for motion in motions])


def test_before_any_face_it_rests() -> None:
    motion = FaceFollower(SCHEME.name).follow(LOST, SIZE, 0.0)
    assert motion.status is FaceStatus.LOST
    assert motion.presence == 0
    assert motion.angles == (0, 0, 0)
    assert motion.expression.shape == (SCHEME.count, 3)
    assert motion.landmarks.shape == (0, 2)
    assert motion.pose is None
    assert motion.neutral is None


def test_the_neutral_pose_is_the_identity() -> None:
    motion = Player(yaw=5, pitch=8, roll=-3).play([face(5, 8, -3)])[0]
    np.testing.assert_allclose(motion.angles, 0, atol=1e-6)
    np.testing.assert_allclose(motion.translation, 0, atol=1e-6)
    np.testing.assert_allclose(motion.expression, 0, atol=1e-3)
    assert motion.presence == 1


@pytest.mark.parametrize(("yaw", "pitch", "roll"), [(20, 0, 0), (0, 15, 0), (0, 0, 25), (-15, 10, 20)])
def test_rotation_is_relative_to_neutral_in_room_axes(yaw: float, pitch: float, roll: float):
    # A camera above the screen sees a head that looks ahead as pitched: that must not tilt its turns.
    tilt = rotation_from_angles(0, 12, 0)
    turned = angles_from_rotation(rotation_from_angles(yaw, pitch, roll) * tilt)
    motion = Player(pitch=12).play([face(*turned)] * 60)[-1]
    np.testing.assert_allclose(motion.angles, (yaw, pitch, roll), atol=0.6)  # the dead band


def test_the_documented_pose_is_the_smoothed_one() -> None:
    motion = Player(pitch=6).play([face(10, 2, 5, at=(3, 1, -48))] * 60)[-1]
    assert motion.neutral is not None
    assert motion.pose is not None
    rotation = motion.rotation * motion.neutral.pose.rotation
    assert (rotation.inv() * motion.pose.rotation).magnitude() == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(motion.neutral.pose.translation + motion.translation, motion.pose.translation)
    np.testing.assert_allclose(motion.translation, (3, 1, 2), atol=0.4)


def test_expression_is_the_change_of_the_head_space_points() -> None:
    speaking = face(15, 5, 0, points=open_mouth(SCHEME, 1.2))
    motion = Player().play([speaking] * 30)[-1]
    lower = list(SCHEME.lip_gap[1])
    np.testing.assert_allclose(motion.expression[lower, 1], -1.2, atol=0.1)
    assert np.abs(motion.expression[list(SCHEME.rigid)]).max() < 0.08


def test_a_blink_of_three_frames_is_not_damped() -> None:
    player = Player()
    motions = player.play([face(points=shut_eyes(SCHEME))] * 3)
    opening = SCHEME.eyes_opening(motions[-1].landmarks)[0]
    assert opening < 0.3 * SCHEME.eyes_opening(face().landmarks)[0]


def test_a_still_noisy_person_is_exactly_still() -> None:
    player = Player()
    motions = player.play([face(noise_px=0.15, seed=seed) for seed in range(120)])
    rotations = np.array([motion.angles for motion in motions])
    assert (rotations == rotations[0]).all()
    landmarks = np.array([motion.landmarks for motion in motions])
    assert landmarks.std(axis=0).mean() < 0.02


def test_a_turning_head_is_followed_without_much_delay() -> None:
    angles = 25 * np.sin(2 * np.pi * 0.5 * np.arange(90) / RATE)
    motions = Player().play([face(angle) for angle in angles])
    assert np.abs(yaws(motions) - angles)[5:].max() < 3.5
    assert np.corrcoef(yaws(motions), angles)[0, 1] > 0.995


def test_a_lost_face_eases_to_neutral_in_half_a_second_and_back() -> None:
    player = Player()
    player.play([face(25)] * 30)
    gone = player.play([LOST] * 30)
    assert yaws(gone)[0] == pytest.approx(25, abs=1)
    assert yaws(gone)[17] == pytest.approx(0, abs=0.01)
    assert gone[17].presence == 0
    assert (np.diff(yaws(gone)) <= 1e-9).all()
    back = player.play([face(25)] * 30)
    assert yaws(back)[0] == pytest.approx(0, abs=0.5)
    assert yaws(back)[-1] == pytest.approx(25, abs=0.6)
    assert back[-1].presence == 1
    assert np.abs(np.diff(yaws(back))).max() < 4


def test_one_missing_frame_is_hardly_seen() -> None:
    player = Player()
    motions = player.play([face(20)] * 30 + [LOST] + [face(20)] * 10)
    assert np.abs(yaws(motions)[25:] - 20).max() < 0.8


def test_landmarks_stay_where_a_lost_face_was_last_seen() -> None:
    player = Player()
    seen = player.play([face(20, at=(4, 2, -50))] * 30)[-1]
    lost = player.play([LOST] * 30)[-1]
    np.testing.assert_array_equal(lost.landmarks, seen.landmarks)
    assert lost.pose is seen.pose


def test_a_face_is_followed_at_once_in_the_first_frame_and_eased_in_when_it_comes_later() -> None:
    assert FaceFollower(SCHEME.name).follow(face(), SIZE, 0.0).presence == 1
    late = FaceFollower(SCHEME.name)
    later = [late.follow(state, SIZE, index / RATE).presence for index, state in enumerate([LOST, *[face()] * 30])]
    assert later[:2] == [0, pytest.approx(0, abs=0.05)]
    assert later[-1] == 1


def test_turning_out_of_reach_eases_to_neutral_and_back_without_a_jump() -> None:
    player = Player()
    turn = np.concatenate([np.linspace(0, 70, 45), np.full(30, 70), np.linspace(70, 10, 40), np.full(30, 10)])
    motions = player.play([face(angle) for angle in turn])
    angles = yaws(motions)
    assert angles.max() < 42
    assert angles[70] == pytest.approx(0, abs=0.01)
    assert motions[70].presence == 0
    assert angles[-1] == pytest.approx(10, abs=0.6)
    assert np.abs(np.diff(angles)).max() < 6
    # The light picture knows better: landmarks go on with the face.
    assert motions[70].pose is not None
    assert angles_from_rotation(motions[70].pose.rotation).yaw == pytest.approx(70, abs=1)


def test_at_the_limit_it_does_not_flutter() -> None:
    player = Player()
    states = [face(angle) for angle in np.linspace(0, 40, 60)]
    wobble = [face(40 + (-1) ** index * 1.5) for index in range(90)]
    presences = np.array([motion.presence for motion in player.play(states + wobble)])[60:]
    assert ((np.diff(np.sign(np.diff(presences[np.abs(np.diff(presences, append=0)) > 0]))) != 0).sum()) <= 1


def test_reset_neutral_takes_the_present_face_and_eases_there() -> None:
    player = Player()
    player.play([face(20)] * 30)
    player.follower.reset_neutral()
    motions = player.play([face(20)] * 60)
    assert yaws(motions)[0] == pytest.approx(20, abs=0.5)
    assert yaws(motions)[-1] == pytest.approx(0, abs=0.3)
    assert np.abs(np.diff(yaws(motions))).max() < 3


def test_reset_neutral_waits_for_a_certain_face() -> None:
    player = Player()
    player.follower.reset_neutral()
    uncertain = player.play([face(20, status=FaceStatus.UNCERTAIN)] * 60)
    assert yaws(uncertain)[-1] == pytest.approx(20, abs=0.5)
    certain = player.play([face(20)] * 60)
    assert yaws(certain)[-1] == pytest.approx(0, abs=0.3)


def test_who_is_first_seen_turned_away_is_not_followed_before_looking_here() -> None:
    follower = FaceFollower(SCHEME.name)
    for index in range(20):
        motion = follower.follow(face(45), SIZE, index / RATE)
    assert motion.angles == (0, 0, 0)
    assert motion.presence == 0
    assert len(motion.landmarks) == SCHEME.count


def test_a_clock_that_goes_back_eases_from_the_end_to_the_beginning() -> None:
    player = Player()
    player.play([face(20)] * 30)
    player.index = 0
    looped = player.play([face(-10)] * 40)
    assert yaws(looped)[0] == pytest.approx(20, abs=1)
    assert yaws(looped)[-1] == pytest.approx(-10, abs=0.5)
    assert np.abs(np.diff(yaws(looped))).max() < 6


def test_another_scheme_is_refused() -> None:
    with pytest.raises(NotFoundError):
        FaceFollower("ibug68")
    with pytest.raises(TrackError, match="mesh478"):
        FaceFollower(SCHEME.name).follow(replace(face(), scheme="mesh478"), SIZE, 0.0)
