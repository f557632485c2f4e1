"""Head motion: reading it, and its errors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import TrackError
from relit_camera.lab.evaluate.video.head_motion_error import (
    HeadMotion,
    pose_error,
    read_head_motion,
    second_difference_rms,
)

TIMES = np.linspace(0, 4, 97)
TURN = np.stack([20 * np.sin(TIMES), 5 * np.cos(2 * TIMES), 0.1 * np.sin(TIMES)], axis=1)


def motion(angles: np.ndarray) -> HeadMotion:
    return HeadMotion(angles, np.zeros((len(angles), 0, 2)))


def test_a_constant_offset_is_no_error() -> None:
    error = pose_error(motion(TURN + [3, -2, 1]), motion(TURN))
    assert error.rms_deg == pytest.approx((0, 0, 0), abs=1e-9)
    assert error.offset_deg == pytest.approx((3, -2, 1))


def test_gain_and_noise_are_found() -> None:
    noise = np.random.default_rng(4).normal(0, 0.5, TURN.shape)
    error = pose_error(motion(TURN * [0.8, 1.1, 1] + noise), motion(TURN))
    assert error.gain[:2] == pytest.approx((0.8, 1.1), abs=0.05)
    assert np.isnan(error.gain[2])
    assert error.rms_deg[2] == pytest.approx(0.5, rel=0.15)


def test_an_error_about_one_axis_is_the_angle_between_the_rotations() -> None:
    wave = np.sqrt(2) * np.sin(2 * np.pi * np.arange(96) / 24)
    still = np.zeros((96, 3))
    turning = still.copy()
    turning[:, 0] = wave
    error = pose_error(motion(turning), motion(still))
    assert error.angle_rms_deg == pytest.approx(1, abs=1e-6)
    assert error.rms_deg == pytest.approx((1, 0, 0), abs=1e-6)


def test_frames_without_a_face_do_not_count() -> None:
    seen = TURN.copy()
    seen[10:20] = np.nan
    error = pose_error(motion(seen), motion(TURN))
    assert error.frames == 87
    assert error.angle_rms_deg == pytest.approx(0, abs=1e-6)
    with pytest.raises(TrackError, match="in common"):
        pose_error(motion(np.full_like(TURN, np.nan)), motion(TURN))
    with pytest.raises(TrackError, match="97 and 96"):
        pose_error(motion(TURN), motion(TURN[:-1]))


def test_a_true_pose_that_nobody_could_see_does_not_count(tmp_path: Path) -> None:
    pose = {"yaw": 1, "pitch": 0, "roll": 0}
    frames = [{"found": index != 1, "pose_deg": pose, "landmarks": [[3, 4]]} for index in range(3)]
    (tmp_path / "truth.json").write_text(json.dumps({"frames": frames}))
    motion = read_head_motion(tmp_path / "truth.json")
    assert np.isnan(motion.angles_deg).all(axis=1).tolist() == [False, True, False]
    assert np.isnan(motion.landmarks).all(axis=(1, 2)).tolist() == [False, True, False]


def test_steady_motion_has_no_jitter_and_noise_has_its_own() -> None:
    steady = np.arange(200.0)[:, None, None] * [1.0, -2.0]
    assert second_difference_rms(steady) == pytest.approx(0, abs=1e-9)
    # The variance of x[t+1] − 2 x[t] + x[t−1] of white noise is 6 times its own.
    noise = np.random.default_rng(5).normal(0, 0.1, (20000, 1))
    assert second_difference_rms(noise) == pytest.approx(0.1 * np.sqrt(6), rel=0.02)
    assert np.isnan(second_difference_rms(np.zeros((2, 1))))


def test_poses_are_read_from_every_kind_of_file(tmp_path: Path) -> None:
    path = tmp_path / "motion.json"
    frames = [
        {"pose": {"yaw": 1, "pitch": 2, "roll": 3}, "landmarks": [[1, 2], [3, 4]], "found": True},
        {"pose": None, "found": False},
        {"pose_deg": {"yaw": 4, "pitch": 5}},
    ]
    path.write_text(json.dumps({"version": 1, "frames": frames}))
    read = read_head_motion(path)
    np.testing.assert_array_equal(read.angles_deg, [[1, 2, 3], [np.nan] * 3, [4, 5, 0]])
    np.testing.assert_array_equal(read.landmarks[0], [[1, 2], [3, 4]])
    assert np.isnan(read.landmarks[1:]).all()


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"frames": []}', '{"frames": [{"pose": {"yaw": "x"}}]}',
     '{"frames": [{"pose": {"yaw": NaN, "pitch": 0}}]}',
     '{"frames": [{"landmarks": [[1, 2]]}, {"landmarks": [[1, 2], [3, 4]]}]}'],
)  # fmt: skip
def test_other_files_are_one_clear_error(text: str, tmp_path: Path) -> None:
    path = tmp_path / "motion.json"
    path.write_text(text)
    with pytest.raises(TrackError, match=r"motion\.json"):
        read_head_motion(path)


def test_what_is_wrong_is_said_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "motion.json"
    for text, place in (('{"frames": [{"pose": {"yaw": "x"}}]}', r"frames\.0\.pose\.yaw"), ("[]", "top level")):
        path.write_text(text)
        with pytest.raises(TrackError, match=place):
            read_head_motion(path)
    with pytest.raises(TrackError, match="cannot read"):
        read_head_motion(tmp_path / "missing.json")
