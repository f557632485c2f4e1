"""Every frame of a file once, written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.replay.video_replay import ReplayedFrame, replay
from relit_camera.app.wiring import make_pipeline
from relit_camera.base.config.look import Lighting, Look
from relit_camera.base.config.settings import InferenceSettings, RelitSettings
from relit_camera.base.errors import VideoError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.face.face_state import LOST, FaceState, Tracker
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.live.pipeline import Pipeline
from relit_camera.live.publishing.what_is_shown import Shown
from relit_camera.live.scene.scene import Scene
from tests.generated_subject import small_subject
from tests.small_camera import SteadyTracker

COUNT, FPS = 12, 12.5


CPU = RelitSettings(inference=InferenceSettings(provider="cpu"))


def clip(folder: Path, size: tuple[int, int] = (96, 64)) -> Path:
    path = folder / "clip.mkv"
    with VideoWriter(path, size, FPS) as video:
        for index in range(COUNT):
            video.write(np.full((size[1], size[0], 3), 40 + 10 * index, np.uint8))
    return path


def play(video: Path, out: Path | None, tracker: Tracker, dark_from_s: float = 9.0) -> list[ReplayedFrame]:
    studio = builtin_environment("studio")
    bright, dark = (
        Scene(Look(lighting=Lighting(exposure_ev=ev, transition_s=0)), studio, None, "small", small_subject())
        for ev in (0, -6)
    )

    def pipeline_for(size: tuple[int, int]) -> Pipeline:
        return make_pipeline(CPU, tracker, size)

    return replay(video, out, pipeline_for, lambda time_s: dark if time_s >= dark_from_s else bright)


def read(path: Path) -> list[DisplayImage]:
    with VideoReader(path) as video:
        return [frame.image for frame in video]


def test_every_frame_once_at_the_videos_size_and_rate(tmp_path: Path) -> None:
    out = tmp_path / "out.mp4"
    frames = play(clip(tmp_path), out, SteadyTracker())
    assert [frame.index for frame in frames] == list(range(COUNT))
    np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(COUNT) / FPS, atol=2e-3)
    with VideoReader(out) as video:
        assert (video.info.width, video.info.height, video.info.fps) == (96, 64, FPS)
        assert len(list(video)) == COUNT


def test_the_report_of_a_frame(tmp_path: Path) -> None:
    told = play(clip(tmp_path), None, SteadyTracker())[-1].as_json()
    assert told["index"] == COUNT - 1
    assert told["state"] == "found"
    assert set(told) == {"index", "time_s", "state", "shown", "pose", "stage_ms"}
    assert isinstance(told["pose"], dict)
    assert set(told["pose"]) == {"yaw", "pitch", "roll"}
    assert ReplayedFrame(0, 0.0, None, Shown.RELIT, {}).as_json()["pose"] is None


def test_the_light_changes_at_its_time(tmp_path: Path) -> None:
    out = tmp_path / "out.mp4"
    play(clip(tmp_path), out, SteadyTracker(), dark_from_s=6 / FPS)
    levels = [picture[16:48, 32:64].mean() for picture in read(out)]
    assert min(levels[:6]) > 2 * max(levels[6:])


class Blind(SteadyTracker):
    def track(self, frame: Frame) -> FaceState:
        return LOST


class Faulty(SteadyTracker):
    def track(self, frame: Frame) -> FaceState:
        if frame.index == 5:
            raise ZeroDivisionError
        return super().track(frame)


def test_nothing_is_left_where_no_face_is_found(tmp_path: Path) -> None:
    video = clip(tmp_path)
    with pytest.raises(VideoError, match="no face was found"):
        play(video, tmp_path / "out.mp4", Blind())
    assert list(tmp_path.iterdir()) == [video]


def test_nothing_is_left_of_a_fault(tmp_path: Path) -> None:
    video = clip(tmp_path)
    with pytest.raises(ZeroDivisionError):
        play(video, tmp_path / "out.mp4", Faulty())
    assert list(tmp_path.iterdir()) == [video]
