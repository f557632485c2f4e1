"""`moving`: how near a moving relit person comes to the truth, on the demonstration's clip."""

from __future__ import annotations

import itertools
import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.config.look import Mode
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_camera.subject.subject_file import read_subject
from relit_studio.drive.moving.moving_table import (
    FIRST_FRAME,
    capture_from_clip,
    error_sheet,
    evaluate_filmed,
    evaluate_mode,
    read_truth,
)
from tests.capture.instant.conftest import models, pulled_models

__all__ = ["models", "pulled_models"]

DEMO = Path(str(files("relit_camera.app.demo") / "data"))
FRAMES = 6


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first frames of the demonstration's clip, which pass for the truth as well; all of them is the person."""
    folder = tmp_path_factory.mktemp("clip")
    with VideoReader(DEMO / "clip.mp4") as frames:
        size = (frames.info.width, frames.info.height)
        with VideoWriter(folder / "clip.mp4", size, 24) as clip, VideoWriter(folder / "matte.mp4", size, 24) as matte:
            for frame in itertools.islice(frames, FRAMES):
                clip.write(frame.image, frame.time_s)
                matte.write(np.full_like(frame.image, 255), frame.time_s)
    track = json.loads((DEMO / "track.json").read_text())
    (folder / "track.json").write_text(json.dumps({**track, "frames": track["frames"][:FRAMES]}))
    return folder


@pytest.mark.slow
def test_the_live_clip_is_its_own_truth(clip: Path) -> None:
    truth = read_truth(clip)
    assert len(truth) == FRAMES
    assert {"person", "face", "hair", "body"} <= set(truth[0].parts)
    figures, shown = evaluate_filmed(clip, truth)
    assert figures.mean("person") > 50
    assert len(shown) == FRAMES - FIRST_FRAME


@pytest.mark.slow
def test_a_mode_is_compared_frame_by_frame(clip: Path) -> None:
    truth, studio = read_truth(clip), EnvironmentStore().resolve("studio")
    subject = read_subject(DEMO / "adam.relit")
    figures, shown = evaluate_mode(clip, truth, subject, studio, Mode.LIVE, f"recorded:{clip / 'track.json'}")
    assert 8 < figures.mean("face") < 40  # another light than the clip's
    sheet = error_sheet(truth, {"live": shown})
    assert sheet.shape[1] > 4 * 100


@pytest.mark.slow
@pytest.mark.usefixtures("models")
def test_an_instant_subject_is_of_the_person_in_the_clip(clip: Path) -> None:
    subject = capture_from_clip(clip)
    assert subject.metadata.rung == "instant"
    true = read_subject(DEMO / "adam.relit")
    own, measured = (np.median(each.neutral[np.asarray(each.matte) > 0.5], axis=0) for each in (subject, true))
    assert np.abs(np.diff(own / own.sum() - measured / measured.sum())).max() < 0.1  # skin, as of the same person
