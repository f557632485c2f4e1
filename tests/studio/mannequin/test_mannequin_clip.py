"""The driving clip, its truth, and the same clip under other light."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import ImageError
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.track_recording import RecordedTracker
from relit_camera.face.tracking.trackers import TrackerOptions
from relit_studio.mannequin.outputs.driving_clip import render_clip, true_state
from relit_studio.mannequin.outputs.mannequin_performance import FRAMES, frame_times, posture_at
from relit_studio.mannequin.rendering.distant_lights import room
from relit_studio.mannequin.rendering.mannequin_camera import Camera

pytestmark = pytest.mark.slow

SMALL = Camera(64)


def test_performance_turns_talks_blinks_and_smiles_without_jumps() -> None:
    postures = [posture_at(float(time_s)) for time_s in frame_times()]
    angles = np.array([posture.angles for posture in postures])
    np.testing.assert_allclose(angles[:, 0].max(), 25)
    np.testing.assert_allclose(angles[:, 0].min(), -25)
    assert (np.ptp(angles[:, 1:], axis=0) > 14).all()
    # A head turns at most about 120 degrees a second here.
    assert np.abs(np.diff(angles, axis=0)).max() < 5
    assert postures[0] == posture_at(0)
    states = [true_state(SMALL, posture) for posture in postures]
    mouths = [state.mouth for state in states]
    eyes = np.array([state.eyes for state in states])
    assert max(mouths) > 0.12
    assert min(mouths) < 0.01
    assert ((eyes < 0.1).sum(axis=0) >= 4).all()
    assert max(posture.expression.smile for posture in postures) == pytest.approx(1, abs=0.01)
    assert len(postures) == FRAMES


def test_track_plays_back_the_truth(generated: Path) -> None:
    tracker = RecordedTracker(TrackerOptions(argument=str(generated / "track.json")))
    truth = json.loads((generated / "truth.json").read_text())
    frames = list(VideoReader(generated / "clip.mp4"))
    assert len(frames) == len(truth["frames"]) == 3
    camera = Camera(frames[0].image.shape[0])
    for frame, stated in zip(frames, truth["frames"], strict=True):
        state, posture = tracker.track(frame), posture_at(frame.time_s)
        assert state.visible
        assert frame.time_s == pytest.approx(stated["time_s"], abs=1e-4)
        assert state.scheme == "mesh478"
        assert landmark_scheme(state.scheme).count == len(state.landmarks)
        expected = true_state(camera, posture)
        np.testing.assert_allclose(state.landmarks, expected.landmarks, atol=0.02)
        assert state.pose is not None
        np.testing.assert_allclose(angles_from_rotation(state.pose.rotation), posture.angles, atol=0.01)
        assert stated["pose"]["yaw"] == pytest.approx(posture.angles.yaw, abs=0.01)
        assert stated["expression"]["jaw"] == pytest.approx(posture.expression.jaw, abs=0.01)


def test_frames_are_exposed_and_the_wall_is_seen(generated: Path) -> None:
    picture = next(iter(VideoReader(generated / "clip.mp4"))).image
    assert 100 < picture[150:190, 130:190].mean() < 200
    assert picture[:20].std(axis=(0, 1)).max() < 8
    assert 60 < picture[:20].mean() < 200


def test_the_same_frames_under_another_light() -> None:
    times = frame_times()[[0, 30]].tolist()
    light = room()
    first = list(render_clip(light, SMALL, times))
    doubled = list(render_clip(2 * light, SMALL, times))
    mirrored = list(render_clip(np.ascontiguousarray(light[:, ::-1]), SMALL, times))
    assert [picture.shape for picture in first] == [(64, 64, 3)] * 2
    for once, twice in zip(first, doubled, strict=True):
        assert once.dtype == np.float32
        np.testing.assert_allclose(twice, 2 * once, rtol=1e-4, atol=1e-5)
    face = np.s_[18:44, 20:44]
    balance = [picture[face][:, :12].mean() / picture[face][:, 12:].mean() for picture in (first[0], mirrored[0])]
    assert balance[0] > 1.05 > 1 / 1.05 > balance[1]


def test_a_wrong_light_map_is_refused() -> None:
    with pytest.raises(ImageError, match="light map"):
        next(render_clip(np.ones((32, 32, 3), np.float32), SMALL))
