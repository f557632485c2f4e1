"""A relit video against the truth."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.errors import VideoError
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.lab.evaluate.video.head_motion_error import HeadMotion
from relit_camera.lab.evaluate.video.relit_video_accuracy import (
    VideoReport,
    compare_videos,
    video_json,
    video_page,
    video_text,
)
from tests.lab.html_outline import Outline

SIZE = 64


def write(path: Path, frames: list[NDArray[np.float32]]) -> Path:
    with VideoWriter(path, (SIZE, SIZE), 24, crf=1) as video:
        for index, frame in enumerate(frames):
            video.write(uint8_from_linear(frame), index / 24)
    return path


def lit(side: float, brightness: float = 0.3) -> NDArray[np.float32]:
    """A gray picture that is brighter at its left (−1) or right (1)."""
    ramp = brightness * (1 + 0.8 * side * np.linspace(-1, 1, SIZE))
    return np.repeat(np.tile(ramp, (SIZE, 1))[..., None], 3, axis=2).astype(np.float32)


MATTE = np.zeros((SIZE, SIZE, 3), np.float32)
cv2.circle(MATTE, (SIZE // 2, SIZE // 2), 20, (1, 1, 1), -1)


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    return write(tmp_path / "truth.mp4", [lit(0.5)] * 8)


@pytest.fixture
def matte(tmp_path: Path) -> Path:
    return write(tmp_path / "matte.mp4", [MATTE] * 8)


def test_an_equal_video_differs_by_rounding_only(truth: Path, tmp_path: Path) -> None:
    light = compare_videos(write(tmp_path / "relit.mp4", [lit(0.5)] * 8), truth)
    assert len(light.psnr_db) == 8
    assert light.psnr_db.min() > 45
    assert abs(light.gain_ev).max() < 0.01
    assert light.flicker < 1e-3


def test_one_stop_too_dark_is_a_gain_of_one(truth: Path, tmp_path: Path) -> None:
    light = compare_videos(write(tmp_path / "relit.mp4", [lit(0.5, 0.15)] * 8), truth)
    np.testing.assert_allclose(light.gain_ev, 1, atol=0.02)
    assert light.psnr_db.max() < 20
    assert light.gain_aligned_db.min() > 38


def test_light_from_the_other_side_stays_wrong(truth: Path, tmp_path: Path) -> None:
    light = compare_videos(write(tmp_path / "relit.mp4", [lit(-0.5)] * 8), truth)
    assert light.gain_aligned_db.max() < 15
    assert light.shading_db.max() < 15


def test_wrong_features_under_right_light_are_told_from_wrong_light(truth: Path, tmp_path: Path) -> None:
    texture = 1 + 0.5 * np.sign(np.random.default_rng(6).normal(size=(SIZE // 2, SIZE // 2)))
    fine = np.repeat(np.repeat(texture, 2, axis=0), 2, axis=1)[..., None].astype(np.float32)
    light = compare_videos(write(tmp_path / "relit.mp4", [lit(0.5) * fine] * 8), truth)
    assert light.shading_db.min() > light.gain_aligned_db.max() + 8


def test_only_the_person_counts(truth: Path, matte: Path, tmp_path: Path) -> None:
    frame = np.where(cv2.dilate(MATTE, np.ones((9, 9))) > 0.5, lit(0.5), 0).astype(np.float32)
    relit = write(tmp_path / "relit.mp4", [frame] * 8)
    assert compare_videos(relit, truth).psnr_db.max() < 15
    assert compare_videos(relit, truth, matte).psnr_db.min() > 40


def test_frames_without_anybody_count_for_nothing(truth: Path, tmp_path: Path) -> None:
    matte = write(tmp_path / "matte.mp4", [MATTE] * 3 + [MATTE * 0] * 2 + [MATTE] * 3)
    light = compare_videos(write(tmp_path / "relit.mp4", [lit(0.5, 0.15)] * 8), truth, matte)
    assert np.flatnonzero(np.isnan(light.psnr_db)).tolist() == [3, 4]
    report = VideoReport(light)
    figures = json.loads(json.dumps(video_json(report), allow_nan=False))
    assert figures["light"]["gain_ev"] == pytest.approx(1, abs=0.02)
    assert figures["jitter"]["brightness_share"] < 1e-3
    assert not re.search(r"\bnan\b", video_page(report, "Clip") + video_text(report))


def test_flicker_is_the_second_difference_of_the_brightness(truth: Path, tmp_path: Path) -> None:
    levels = [0.30, 0.33] * 4
    light = compare_videos(write(tmp_path / "relit.mp4", [lit(0.5, level) for level in levels]), truth)
    seen = [float(linear_from_uint8(uint8_from_linear(lit(0.5, level))).mean()) for level in levels]
    assert light.flicker == pytest.approx(2 * (seen[1] - seen[0]) / np.mean(seen), rel=0.05)
    assert light.true_flicker < 1e-3


def test_videos_that_do_not_fit_are_one_clear_error(truth: Path, tmp_path: Path) -> None:
    shorter = write(tmp_path / "short.mp4", [lit(0.5)] * 5)
    for pair in ((shorter, truth), (truth, shorter)):
        with pytest.raises(VideoError, match="differ in length after 5 frames"):
            compare_videos(*pair)
    with pytest.raises(VideoError, match=r"short\.mp4 differ in length after 5 frames"):
        compare_videos(truth, truth, shorter)
    with VideoWriter(tmp_path / "small.mp4", (32, 32), 24) as video:
        video.write(np.zeros((32, 32, 3), np.uint8), 0.0)
    with pytest.raises(VideoError, match="32x32"):
        compare_videos(tmp_path / "small.mp4", truth)
    with pytest.raises(VideoError, match="empty in every frame"):
        compare_videos(truth, truth, write(tmp_path / "black.mp4", [MATTE * 0] * 8))


@pytest.mark.slow
def test_the_report_is_whole_in_itself(truth: Path, matte: Path) -> None:
    angles = np.stack([np.linspace(-20, 20, 8), np.zeros(8), np.zeros(8)], axis=1)
    points = np.random.default_rng(7).normal(size=(8, 5, 2))
    motion, known = HeadMotion(angles + 1, points), HeadMotion(angles, points * 0)
    report = VideoReport(compare_videos(truth, truth, matte), motion, known)
    outline = Outline()
    outline.feed(video_page(report, "Clip"))
    assert outline.fetched == outline.open == []
    assert outline.figures == outline.captions >= 7
    figures = json.loads(json.dumps(video_json(report), allow_nan=False))
    assert figures["pose"]["yaw_gain"] == pytest.approx(1)
    assert figures["pose"]["roll_gain"] is None
    assert figures["jitter"]["landmarks_px"] > figures["jitter"]["true_landmarks_px"] == 0
    assert "pose" in video_text(report)


def test_equal_frames_are_no_infinity_in_json(truth: Path) -> None:
    figures = video_json(VideoReport(compare_videos(truth, truth)))
    json.dumps(figures, allow_nan=False)
    assert figures["pose"] is None


@pytest.mark.parametrize(("frames", "level", "flicker"), [(8, 0.0, 0.0), (2, 0.3, None)])
def test_a_black_and_a_very_short_video_have_figures(
    frames: int, level: float, flicker: float | None, tmp_path: Path
) -> None:
    relit = write(tmp_path / "relit.mp4", [lit(0.5, level)] * frames)
    report = VideoReport(compare_videos(relit, write(tmp_path / "truth.mp4", [lit(0.5)] * frames)))
    figures = json.loads(json.dumps(video_json(report), allow_nan=False))
    assert figures["jitter"]["brightness_share"] == flicker
    assert video_page(report, "Clip").startswith("<!doctype html>")
