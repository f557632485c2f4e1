"""Films in, samples out, against what was put in; and films that are refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.capture.chain.options import CaptureOptions
from relit_camera.capture.chain.samples import CaptureResult, build_samples
from relit_camera.capture.face_circle import Circle
from relit_camera.errors import CaptureError, ConfigError, VideoError
from tests.capture.ball.mirror_scene import degrees_between
from tests.capture.film import FOCAL_PX, HEAD, PX_PER_CM, SIZE, Film, write_film
from tests.cli.relit_command import call

OPTIONS = CaptureOptions(gamma=2.2, size=96, focal_px=FOCAL_PX, face=Circle(*HEAD, 9.5 * PX_PER_CM))


@pytest.fixture(scope="module")
def codes() -> np.ndarray:
    return Film().codes()


@pytest.fixture(scope="module")
def built(codes: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> CaptureResult:
    return build_samples(write_film(tmp_path_factory.mktemp("film") / "film.mp4", codes), OPTIONS)


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
    film, samples, square = Film(), built.samples, built.findings.square
    normals = film.surface[0]
    reflectance = film.reflectance.astype(np.float32)
    x, y = film.shift(built.findings.seen.motion.reference)
    back = np.array([[1, 0, x], [0, 1, y]])
    inside = samples.matte > 0.99
    ratios = []
    for picture, direction in zip(samples.pictures, samples.directions, strict=True):
        shade = np.maximum(normals @ direction, 0)[..., None].astype(np.float32)
        moved = cv2.warpAffine(reflectance * shade, back, SIZE)
        left, top, side = round(square.left), round(square.top), round(square.side)
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


def test_the_room_is_taken_off(built: CaptureResult) -> None:
    report = built.findings.report()
    assert report["room"]["taken_off"]
    assert report["room"]["left"] < 0.02
    shaded = built.samples.pictures[built.samples.directions[:, 0].argmin()][:, 60:66]
    assert np.median(shaded[built.samples.matte[:, 60:66] > 0.99]) < 0.02


def _no_ball(codes: np.ndarray) -> np.ndarray:
    without = codes.copy()
    without[:, 30:110, 150:240] = codes[:, 30:110, 0:90]
    return without


def _white_ball(codes: np.ndarray) -> np.ndarray:
    white = codes.copy()
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    white[:, np.hypot(x + 0.5 - 190.6, y + 0.5 - 69) < 30] = 255
    return white


def _walked_away(codes: np.ndarray) -> np.ndarray:
    gone = codes.copy()
    gone[150:, 90:, :] = np.median(codes[150:, 20:60, 0:60], axis=(1, 2))[:, None, None]
    return gone


@pytest.mark.parametrize(
    ("spoil", "told", "cure"),
    [
        (lambda codes: np.repeat(codes[4:5], 60, axis=0), "no flash found", "let a light blink"),
        (lambda codes: codes[:24], "flashes found", "half a minute"),
        (_no_ball, "no mirror ball was found", "put a shiny ball"),
        (lambda codes: codes[:, :, :194], "cut off by the picture's right edge", "all of the ball"),
        (_white_ball, "over-exposed", "lower the exposure"),
        (_walked_away, "the face is found in", "sit still"),
    ],
    ids=["no flash", "too short", "no ball", "ball cut off", "ball too bright", "walked away"],
)
def test_a_bad_film_is_refused(
    codes: np.ndarray, tmp_path: Path, spoil: Callable[[np.ndarray], np.ndarray], told: str, cure: str
) -> None:
    film = write_film(tmp_path / "film.mp4", spoil(codes))
    with pytest.raises(CaptureError) as refused:
        build_samples(film, OPTIONS)
    assert told in refused.value.what
    assert cure in refused.value.cure


def test_a_face_outside_of_the_picture_is_refused_before_a_frame_is_read(codes: np.ndarray, tmp_path: Path) -> None:
    told: list[str] = []
    options = replace(OPTIONS, face=Circle(SIZE[0] + 5, 60, 40))
    video = write_film(tmp_path / "film.mp4", codes[:12])
    with pytest.raises(ConfigError, match=f"face at {SIZE[0] + 5}, 60 is outside of the picture, which is {SIZE[0]}x"):
        build_samples(video, options, lambda stage, done, total: told.append(stage))
    assert not told


def test_too_few_lights_are_refused(codes: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="usable directions of light"):
        build_samples(write_film(tmp_path / "film.mp4", codes[:75]), OPTIONS)


def test_a_cut_off_file_is_refused(codes: np.ndarray, tmp_path: Path) -> None:
    film = write_film(tmp_path / "film.mp4", codes[:60])
    film.write_bytes(film.read_bytes()[:-4000])
    with pytest.raises(VideoError, match="cut off"):
        build_samples(film, OPTIONS)


def test_the_command_leaves_nothing_of_a_bad_film(codes: np.ndarray, tmp_path: Path) -> None:
    film = write_film(tmp_path / "film.mp4", np.repeat(codes[4:5], 60, axis=0))
    out = tmp_path / "out"
    out.mkdir()
    call("capture", "build", film, "--out", out / "me.relit", "--report", out / "me.json").complains("no flash found")
    assert list(out.iterdir()) == []
