"""Flashes found in the brightness of simulated films, and the class of every frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, VideoError
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.flash_schedule import find_flash_frequency
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid, measure_brightness
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass, detect_flashes
from tests.capture.film.blinking_film import LIT_COLUMNS, LIT_ROWS, Blinking, film

ORDINARY = Blinking(hz=5.07)

STEADY = {
    "as the thesis records": ORDINARY,
    "24 frames, 8 flashes": Blinking(fps=24, hz=7.9, exposure_s=0.01, readout_s=0.01, seconds=10),
    "60 frames, 8 flashes, short flashes": Blinking(fps=60, hz=7.73, duty=0.42, exposure_s=0.01),
    "60 frames, 3 flashes": Blinking(fps=60, hz=3.05, duty=0.6, exposure_s=0.005, readout_s=0.008),
    "50 frames, read upwards": Blinking(fps=50, hz=6.5, readout_s=-0.018, exposure_s=0.012),
    "held upright: columns": Blinking(fps=29.97, hz=5.1, sideways=True),
    "columns from the right": Blinking(fps=25, hz=4.1, sideways=True, readout_s=-0.016, exposure_s=0.025),
    "all rows at once": Blinking(hz=5.3, readout_s=0.0005),
    "slow mode": Blinking(hz=1.9, seconds=12, exposure_s=0.03),
    "slower still": Blinking(hz=0.9, seconds=20, fps=24, exposure_s=0.01),
    "frames at uneven times": Blinking(uneven_s=0.003, hz=4.4),
    "no part shows the gain": Blinking(wall=False, hz=5.63),
    "in step with the frames": Blinking(hz=5.0, phase=0.37),
}


def kinds_of(flashes: Flashes) -> np.ndarray:
    return np.array([frame.kind.value for frame in flashes.frames])


@pytest.mark.slow
@pytest.mark.parametrize("name", STEADY)
def test_whole_and_partial_frames_are_distinguished(name: str) -> None:
    scene = STEADY[name]
    seen, lit = film(scene)
    kinds = kinds_of(flashes := detect_flashes(seen))
    bright, dark = lit.min(axis=1) >= 0.98, lit.max(axis=1) <= 0.02
    assert flashes.schedule.frequency_hz == pytest.approx(scene.hz, rel=0.01)
    assert flashes.schedule.duty == pytest.approx(scene.duty, abs=0.04)
    visible = lit[:, LIT_COLUMNS if scene.sideways else LIT_ROWS]
    assert visible[kinds == "bright"].min() > 0.95
    assert visible[kinds == "dark"].max() < 0.05
    assert (kinds[bright] == "bright").mean() >= 0.91
    assert (kinds[dark] == "dark").mean() >= 0.91
    flash = np.array([frame.flash for frame in flashes.frames])
    assert len(np.unique(flash[bright & (kinds == "bright")])) >= 0.95 * len(np.unique(flash[bright]))


@pytest.mark.slow
def test_the_shutter_is_found() -> None:
    shutter = detect_flashes(film(ORDINARY)[0]).shutter
    assert shutter.exposure_s == pytest.approx(1 / 60, rel=0.1)
    assert shutter.readout_s == pytest.approx(0.018, rel=0.1)
    assert not shutter.by_columns
    assert detect_flashes(film(STEADY["held upright: columns"])[0]).shutter.by_columns


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_flash_that_jitters_is_followed(seed: int) -> None:
    seen, lit = film(Blinking(jitter_s=0.002, hz=4.7, seed=seed))
    kinds = kinds_of(detect_flashes(seen))
    assert lit[kinds == "bright", LIT_ROWS].min() > 0.85
    assert (kinds[lit.min(axis=1) >= 0.98] == "bright").mean() > 0.9


@pytest.mark.slow
def test_gains_are_read_where_the_flash_does_not_reach() -> None:
    seen, _ = film(replace(ORDINARY, hunting=0.3))
    signal = detect_flashes(seen).signal
    assert np.ptp(signal.gains) > 0
    expected = 0.3 * np.sin(2.1 * seen.times_s)
    assert np.std(np.log(signal.gains) - expected) < 0.03  # but for what the flashes themselves do to the gain
    assert np.ptp(detect_flashes(film(STEADY["no part shows the gain"])[0]).signal.gains) == 0


@pytest.mark.slow
def test_flashes_that_point_elsewhere_are_rejected() -> None:
    scene = replace(ORDINARY, lapses=(3.0, 6.1))
    seen, lit = film(scene)
    flashes = detect_flashes(seen)
    weak = [frame for frame in flashes.frames if frame.kind is FrameClass.REJECTED]
    times = np.array([frame.time_s for frame in weak])
    assert {3, 6} == set(np.round(times).astype(int))
    assert all("weak flash" in frame.reason for frame in weak)
    # The light's strength there is 1 - 0.85 exp(-(t / 0.25)²): below 0.4 within 0.15 s.
    bright = lit.min(axis=1) >= 0.98
    away = np.min(np.abs(seen.times_s[:, None] - scene.lapses), axis=1)
    kinds = kinds_of(flashes)
    assert (kinds[bright & (away < 0.1)] != "bright").all()
    assert (kinds[bright & (away > 0.4)] == "bright").mean() > 0.95


@pytest.mark.slow
def test_a_frame_that_a_hand_darkens_is_rejected() -> None:
    seen, lit = film(ORDINARY)
    index = int(np.flatnonzero(lit.min(axis=1) >= 0.98)[20])
    cells = seen.cells.copy()
    cells[index, 10:18] *= 0.4
    frame = detect_flashes(replace(seen, cells=cells)).frames[index]
    assert frame.kind is FrameClass.REJECTED
    assert frame.reason == "not lit like the bright frames beside it"


@pytest.mark.slow
def test_only_the_circle_counts_where_the_face_is_known() -> None:
    seen, _ = film(ORDINARY)
    cells = seen.cells.copy()
    cells[:, :6, 18:] += 0.8 * (np.sin(2 * np.pi * 2.3 * seen.times_s) > 0)[:, None, None]  # a blinking advertisement
    seen = replace(seen, cells=cells)
    flashes = detect_flashes(seen, circle=FaceCircle(270, 400, 150))
    assert flashes.schedule.frequency_hz == pytest.approx(5.07, rel=0.01)


@pytest.mark.slow
def test_indices_and_times() -> None:
    seen, _ = film(ORDINARY)
    flashes = detect_flashes(seen)
    assert [frame.index for frame in flashes.frames] == list(range(240))
    np.testing.assert_allclose(flashes.times_s, seen.times_s)
    counted = sum(len(flashes.indices(kind)) for kind in FrameClass)
    assert counted == 240
    numbers = np.array([flashes.frames[index].flash for index in flashes.indices(FrameClass.BRIGHT)])
    assert (np.diff(numbers) >= 0).all()
    assert len(np.unique(numbers)) == pytest.approx(40, abs=1)


def constant(seen: BrightnessGrid, level: np.ndarray) -> BrightnessGrid:
    noise = np.random.default_rng(3).normal(0, 0.0006, seen.cells.shape)
    return replace(seen, cells=(seen.cells[0] * np.asarray(level)[:, None, None] + noise).astype(np.float32))


def test_without_a_flash() -> None:
    seen, _ = film(ORDINARY)
    with pytest.raises(CaptureError, match=r"no flash found: the brightness stays within \d+%; let a light blink"):
        detect_flashes(constant(seen, np.ones(240)))


def test_a_light_that_is_on_all_the_time() -> None:
    seen, _ = film(ORDINARY)
    level = 1.5 + np.sin(2 * np.pi * 0.3 * seen.times_s)
    with pytest.raises(CaptureError, match="nothing blinks; the light must not be on all the time"):
        detect_flashes(constant(seen, level))


def test_a_light_that_is_waved() -> None:
    seen, _ = film(ORDINARY)
    level = 1.5 + np.sin(2 * np.pi * 1.3 * seen.times_s)
    with pytest.raises(CaptureError, match="nothing blinks"):
        detect_flashes(constant(seen, level))


@pytest.mark.slow
@pytest.mark.parametrize("scene", [Blinking(fps=24, hz=8, exposure_s=1 / 25), Blinking(fps=30, hz=12)])
def test_a_flash_too_fast_for_the_frames(scene: Blinking) -> None:
    with pytest.raises(CaptureError, match=r"too fast for \d+ frames a second.*let it blink at most [45] times"):
        detect_flashes(film(scene)[0])


def test_too_few_flashes() -> None:
    with pytest.raises(CaptureError, match=r"only \d flashes found; record half a minute"):
        detect_flashes(film(Blinking(seconds=1.2))[0])


@pytest.mark.parametrize("hz", [0.9, 2.5, 5, 7.3])
def test_the_frequency_is_found_though_it_drifts(hz: float) -> None:
    times = np.cumsum(np.full(600, 1 / 30))
    phase = np.cumsum(np.full(600, hz / 30) * np.linspace(0.98, 1.02, 600))
    level = 0.05 + 0.3 * (phase % 1 < 0.5) * (1.2 + np.sin(0.8 * times))
    beat = find_flash_frequency(level, times)
    assert beat.frequency_hz == pytest.approx(hz, rel=0.03)
    assert beat.fraction > 0.3


def test_a_video_is_watched_in_linear_light(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    with VideoWriter(path, (128, 192), 30, crf=4) as video:
        for index in range(12):
            image = np.full((192, 128, 3), 60, np.uint8)
            image[96:, 64:] = 188 if index % 4 < 2 else 60
            video.write(image)
    watched: list[int] = []
    seen = measure_brightness(path, progress=watched.append)
    assert seen.size == (128, 192)
    assert seen.cells.shape == (12, 32, 21)
    assert watched == list(range(1, 13))
    # sRGB 188 is half of the light, 60 is 4.5 %.
    assert seen.cells[0, 20:30, 14:18].mean() == pytest.approx(0.5, abs=0.01)
    assert seen.cells[2, 20:30, 14:18].mean() == pytest.approx(0.045, abs=0.003)
    assert seen.interval_s == pytest.approx(1 / 30, abs=1e-3)


def test_a_video_of_few_frames_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    with VideoWriter(path, (64, 64), 30) as video:
        video.write(np.zeros((64, 64, 3), np.uint8))
    with pytest.raises(VideoError, match="1 frames only"):
        measure_brightness(path)
