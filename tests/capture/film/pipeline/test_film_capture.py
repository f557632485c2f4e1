"""The whole capture, against the head, lamps, gains and motion from which its film was made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import ConfigError, InputError
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.olat.olat_pictures import max_pictures_in_memory
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.film.pipeline.film_capture import CaptureResult, build_samples
from tests.capture.film.ball.mirror_scene import degrees_between
from tests.capture.film.generated_film import FOCAL_PX, HEAD, PX_PER_CM, SIZE, Film, write_film

pytestmark = pytest.mark.slow

OPTIONS = CaptureOptions(gamma=2.2, size=96, focal_px=FOCAL_PX, face=FaceCircle(*HEAD, 9.5 * PX_PER_CM))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> CaptureResult:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RELIT_MODELS_DIR", str(tmp_path_factory.mktemp("models")))
        return build_samples(write_film(tmp_path_factory.mktemp("film") / "film.mp4", Film().codes()), OPTIONS)


def test_lamps_gains_and_motion_are_those_of_the_film(built: CaptureResult) -> None:
    film, frames = Film(), built.findings.report()["frames"]
    bright = [frame for frame in frames if frame["kind"] == "bright"]
    assert len(bright) > 70
    assert all(film.lit(frame["index"]) > 0.97 for frame in bright)
    error = [degrees_between(np.array(frame["direction"]), film.lamp_cm(frame["index"])) for frame in bright]
    assert np.mean(error) < 2
    gains = np.array([np.log(frame["gain"]) - np.log(film.gain(frame["index"])) for frame in bright])
    assert gains.std(axis=0).max() < 0.02
    moved = np.array([np.add(frame["translation_px"], film.shift(frame["index"])) for frame in bright])
    assert moved.std(axis=0).max() < 0.2


def test_samples_are_pictures_under_distant_lights(built: CaptureResult) -> None:
    film, samples, crop = Film(), built.samples, built.findings.crop
    normals = film.surface[0]
    reflectance = film.reflectance.astype(np.float32)
    x, y = film.shift(built.findings.motion.reference)
    back = np.array([[1, 0, x], [0, 1, y]])
    inside = samples.matte > 0.99
    ratios = []
    for picture, direction in zip(samples.pictures, samples.directions, strict=True):
        shade = np.maximum(normals @ direction, 0)[..., None].astype(np.float32)
        moved = cv2.warpAffine(reflectance * shade, back, SIZE)
        left, top, side = round(crop.left), round(crop.top), round(crop.side)
        wanted = cv2.resize(
            moved[top : top + side, left : left + side], samples.matte.shape, interpolation=cv2.INTER_AREA
        )
        lit = inside & (wanted.mean(axis=2) > 0.1)
        ratios.append(picture[lit].mean(axis=1) / wanted[lit].mean(axis=1))
    unit = np.median(np.concatenate(ratios))
    errors = np.concatenate([np.abs(ratio / unit - 1) for ratio in ratios])
    assert np.median(errors) < 0.06
    assert np.abs(samples.matte.mean() - 0.5) < 0.2
    assert samples.pictures[:, samples.matte == 0].max() == 0


def test_the_report_has_the_gain_of_the_near_field_correction(built: CaptureResult) -> None:
    near = built.findings.report()["near_field"]
    assert 0 < near["misfit"] < near["misfit_if_far"]


def test_the_room_is_subtracted(built: CaptureResult) -> None:
    report = built.findings.report()
    assert report["room"]["taken_off"]
    assert report["room"]["left"] < 0.02
    shaded = built.samples.pictures[built.samples.directions[:, 0].argmin()][:, 60:66]
    assert np.median(shaded[built.samples.matte[:, 60:66] > 0.99]) < 0.02


def test_a_good_film_warns_of_the_missing_detector_only(built: CaptureResult) -> None:
    assert all("no face detector is installed" in warning for warning in built.findings.warnings)


@pytest.mark.parametrize(
    ("detector", "visible", "messages"),
    [
        (False, 0.9, ["the flash reaches everything", "no face detector is installed"]),
        (True, 0.0, ["the room is too dark", "the eyes are not found"]),
    ],
)
def test_warnings(built: CaptureResult, detector: bool, visible: float, messages: list[str]) -> None:
    gains = replace(built.findings.gains, fraction=0.0, visible=visible)
    amiss = replace(built.findings, gains=gains, detector_installed=detector, eyes_px=None)
    warnings = amiss.warnings[-2:]
    assert all(warning.startswith(start) for warning, start in zip(warnings, messages, strict=True))


def test_a_size_that_memory_cannot_hold_is_refused(tmp_path: Path) -> None:
    assert max_pictures_in_memory(96) == max_pictures_in_memory(512) == 600
    assert 150 <= max_pictures_in_memory(1024) < 160
    with pytest.raises(InputError, match=r"1200 pixels a side.*--size of 1024 or less"):
        build_samples(tmp_path / "film.mp4", replace(OPTIONS, size=1200))


def test_a_face_outside_of_the_picture_is_refused_before_a_frame_is_read(tmp_path: Path) -> None:
    messages: list[str] = []
    options = replace(OPTIONS, face=FaceCircle(SIZE[0] + 5, 60, 40))
    video = write_film(tmp_path / "film.mp4", np.zeros((12, *SIZE[::-1], 3), np.uint8))
    with pytest.raises(ConfigError, match=f"face at {SIZE[0] + 5}, 60 is outside of the picture, which is {SIZE[0]}x"):
        build_samples(video, options, lambda stage, done, total: messages.append(stage))
    assert not messages


@pytest.mark.study
def test_what_follows_the_flashes_in_constant_light_is_no_part_of_the_capture(
    built: CaptureResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "models"))
    codes = Film().codes()
    lit = codes[-60:].max(axis=0)
    turning = np.stack([np.roll(lit, round(30 * np.sin(index / 20)), axis=1) for index in range(180)])
    with_coda = build_samples(write_film(tmp_path / "film.mp4", np.concatenate([codes, turning])), OPTIONS)
    report, alone = with_coda.findings.report(), built.findings.report()
    assert alone["coda"] is None
    assert report["coda"] == pytest.approx(len(codes), abs=24)
    assert len(report["frames"]) == report["coda"]
    assert with_coda.findings.lights > 0.9 * built.findings.lights
    bright = [frame for frame in report["frames"] if frame["kind"] == "bright"]
    error = [degrees_between(np.array(frame["direction"]), Film().lamp_cm(frame["index"])) for frame in bright]
    assert np.mean(error) < 2
    assert with_coda.findings.warnings == built.findings.warnings
