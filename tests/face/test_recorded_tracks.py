"""The trackers on a recording whose truth is known."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relit_camera.base.images.image_types import Frame
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.motion.face_follower import FaceFollower, FaceMotion
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker

FOCAL_PX = 320 * 50 / 24
"""The clip was rendered with a 50 mm lens on a sensor 24 mm wide, at 320 pixels."""
SETTLED = 15
"""Frames to leave out: the follower begins with a makeshift neutral face."""


@dataclass
class Replay:
    states: list[FaceState]
    motions: list[FaceMotion]
    head: list[Rotation]
    jaw_open: np.ndarray
    blink: np.ndarray


@pytest.fixture(scope="module", params=["mesh", "openseeface"])
def replay(request: pytest.FixtureRequest, shared: Path, pulled_face_models: Path) -> Replay:
    clip = shared / "driving" / "adam_talk.mp4"
    truth = json.loads(clip.with_suffix(".json").read_text())["frames"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RELIT_MODELS_DIR", str(pulled_face_models))
        tracker = open_tracker(request.param, TrackerOptions(focal_px=FOCAL_PX))
    follower = FaceFollower(tracker.scheme)
    states, motions = [], []
    with av.open(str(clip)) as video:
        for index, picture in enumerate(video.decode(video=0)):
            frame = Frame(picture.to_ndarray(format="rgb24"), index, 0.0, index / 24)
            states.append(tracker.track(frame))
            motions.append(follower.follow(states[-1], frame.size, frame.time_s))
    # The renderer turned the head by yaw first and about the picture's axes, with pitch counted up.
    head = [Rotation.from_euler("yx", [frame["yaw_deg"], -frame["pitch_deg"]], degrees=True) for frame in truth]
    weights = [frame["weights"] for frame in truth]
    return Replay(
        states,
        motions,
        head,
        np.array([weight["jawOpen"] for weight in weights]),
        np.array([weight["eyeBlink_R"] for weight in weights]),
    )


def correlation(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.corrcoef(first, second)[0, 1])


@pytest.mark.slow
def test_every_frame_is_found(replay: Replay):
    assert [state.status for state in replay.states] == [FaceStatus.FOUND] * 96


def test_head_pose_against_truth(replay: Replay):
    measured = [Rotation.from_matrix(state.pose.rotation.as_matrix()) for state in replay.states if state.pose]
    offset = Rotation.concatenate(
        [pose * truth.inv() for pose, truth in zip(measured, replay.head, strict=True)]
    ).mean()
    errors = [
        (offset.inv() * pose * truth.inv()).as_rotvec(degrees=True)
        for pose, truth in zip(measured, replay.head, strict=True)
    ]
    pitch, yaw, roll = np.sqrt(np.square(errors).mean(axis=0))
    bounds = {"mesh478": (1.2, 0.9, 1.0), "openseeface66": (1.2, 4.5, 1.2)}[replay.states[0].scheme]
    assert (np.array([pitch, yaw, roll]) < bounds).all()


def test_mouth_follows_the_jaw(replay: Replay):
    assert correlation(np.array([state.mouth for state in replay.states]), replay.jaw_open) > 0.93


def test_blendshapes_follow_jaw_and_blink(replay: Replay):
    scores = [state.blendshapes for state in replay.states]
    if replay.states[0].scheme == "openseeface66":
        assert not any(scores)
        return
    assert correlation(np.array([score["jawOpen"] for score in scores]), replay.jaw_open) > 0.88
    assert correlation(np.array([score["eyeBlinkRight"] for score in scores]), replay.blink) > 0.95


def test_the_followed_motion_is_the_heads(replay: Replay):
    neutral = replay.head[0]
    expected = np.array([(head * neutral.inv()).as_euler("YXZ", degrees=True) for head in replay.head])
    got = np.array([motion.angles for motion in replay.motions])
    assert correlation(got[SETTLED:, 0], expected[SETTLED:, 0]) > 0.99
    assert correlation(got[SETTLED:, 1], expected[SETTLED:, 1]) > 0.93
    assert all(motion.presence == 1 for motion in replay.motions[SETTLED:])


def test_turning_hardly_leaks_into_the_expression(replay: Replay):
    rigid = list(landmark_scheme(replay.states[0].scheme).rigid)
    leak = [np.linalg.norm(motion.expression[rigid], axis=1).mean() for motion in replay.motions[SETTLED:]]
    assert np.mean(leak) < 0.2  # centimetres


def test_lips_keep_the_speed_of_speech(replay: Replay):
    upper, lower = (list(side) for side in landmark_scheme(replay.states[0].scheme).lip_gap)
    gap = np.array([(motion.expression[upper, 1] - motion.expression[lower, 1]).mean() for motion in replay.motions])
    assert correlation(gap[SETTLED:], replay.jaw_open[SETTLED:]) > 0.92


def test_smoothed_landmarks_lie_on_the_face(replay: Replay):
    scheme = landmark_scheme(replay.states[0].scheme)
    errors = [
        np.linalg.norm(motion.landmarks - state.landmarks, axis=1).mean() / scheme.eye_span(state.landmarks)
        for motion, state in zip(replay.motions, replay.states, strict=True)
    ]
    assert np.mean(errors) < 0.02
