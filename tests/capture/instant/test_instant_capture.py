"""Instant capture: a usable subject, and one line for each picture that none can be made of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, ModelError
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_files import read_display
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.instant.instant_capture import (
    build_instant_subject,
    capture_from_picture,
    capture_instant,
)
from relit_camera.light.directions import texel_solid_angles
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject, write_subject
from tests.capture.instant.lit_person import SIDE, SKIN, facing_irradiance, field_of, picture_of, window


@pytest.fixture(scope="module")
def subject() -> Subject:
    """Of the person whose truth is known, in a room with a window at the left."""
    light = window(-45)
    light *= 0.7 / facing_irradiance(light)
    return capture_from_picture(picture_of(SKIN, light), "webcam").subject


def frames_of(path: Path, count: int) -> list[DisplayImage]:
    """Frames of a video, evenly over it."""
    with VideoReader(path) as reader:
        frames = [frame.image for frame in reader]
    return frames[:: max(1, len(frames) // count)]


@pytest.mark.slow
def test_it_is_an_ordinary_subject(subject: Subject, tmp_path: Path) -> None:
    write_subject(tmp_path / "me.relit", subject)
    again = read_subject(tmp_path / "me.relit")
    meta = again.metadata
    assert again.size == (SIDE, SIDE)
    assert (meta.rung, meta.method, meta.lights, meta.measured_fraction) == ("instant", "instant", 1, 0.0)
    assert meta.expected_db is not None
    assert meta.texel_psnr_db is not None
    assert meta.texel_psnr_db > 30
    assert set(again.landmarks) == {"mesh478"}
    for name in ("normals", "albedo", "depth", "horizons"):
        assert getattr(again, name) is not None
    assert again.depth is not None
    assert not again.depth[again.matte == 0].any()


@pytest.mark.slow
def test_the_source_image_is_the_picture_itself(subject: Subject) -> None:
    light = window(-45)
    light *= 0.7 / facing_irradiance(light)
    np.testing.assert_array_equal(subject.neutral, picture_of(SKIN, light).image)


def test_in_the_rooms_own_light_it_looks_as_it_was_seen(subject: Subject) -> None:
    own = subject.basis.at(subject.light_coefficients, np.arange(SIDE * SIDE)).reshape(SIDE, SIDE, 3)
    assert psnr(own, linear_from_uint8(subject.neutral), subject.matte * (subject.matte > 0.95)) > 25
    assert subject.light_directions[0, 0] < -0.5


@pytest.mark.parametrize("azimuth", [-20, 45, 80])
def test_in_another_light_it_looks_as_the_person_does_there(subject: Subject, azimuth: float) -> None:
    """Truth is the same generic head; the light and the skin were estimated. Tinting the picture is far worse."""
    light = window(azimuth, 10)
    truth = field_of(SKIN).pictures(light[None])[0]
    light_map = (light.reshape(32, 64, 3) / texel_solid_angles()[..., None]).astype(np.float32)
    relit = BasisRelighter(subject).relight(light_map[None])[0]
    matte = subject.matte * (subject.matte > 0.95)
    inside = matte > 0.5
    gain = (relit * truth)[inside].sum() / (relit**2)[inside].sum()
    live = linear_from_uint8(subject.neutral)
    tinted = live * (truth[inside].mean(axis=0) / live[inside].mean(axis=0))
    assert gain == pytest.approx(1, abs=0.3)
    assert psnr(relit * gain, truth, matte) > 24
    if azimuth > 0:
        assert psnr(relit * gain, truth, matte) > psnr(tinted.astype(np.float32), truth, matte) + 5


@pytest.mark.slow
def test_light_that_the_head_does_not_explain_is_not_kept_as_color() -> None:
    light = window(-45)
    light *= 0.7 / facing_irradiance(light)
    picture = picture_of(SKIN, light)
    sides = np.exp(np.interp(np.arange(SIDE), [0.35 * SIDE, 0.65 * SIDE], np.log([1.3, 0.4]))).astype(np.float32)
    lit = linear_from_uint8(picture.image) * sides[None, :, None]
    subject = capture_from_picture(replace(picture, image=uint8_from_linear(lit)), "webcam").subject
    ahead = (window(0, 10).reshape(32, 64, 3) / texel_solid_angles()[..., None]).astype(np.float32)
    relit = BasisRelighter(subject).relight(ahead[None])[0]
    left, right = (
        relit[SIDE // 2 - 10 : SIDE // 2 + 10, SIDE // 2 + column : SIDE // 2 + column + 8].mean()
        for column in (-20, 12)
    )
    assert left / right == pytest.approx(1, abs=0.15)


@pytest.mark.slow
def test_a_harsh_room_is_noticed() -> None:
    soft, harsh = window(0), window(85, 5, 30, around=0.0)
    assert not capture_from_picture(picture_of(SKIN, soft * np.float32(0.7 / facing_irradiance(soft))), "a").warnings
    bright = harsh * np.float32(0.5 / facing_irradiance(window(60)))
    warnings = capture_from_picture(picture_of(SKIN, bright), "a").warnings
    assert len(warnings) == 1
    assert "turn toward the window" in warnings[0]


@pytest.mark.parametrize(("factor", "words"), [(0.003, "too dark in webcam"), (20.0, "over-exposed")])
def test_a_face_that_is_black_or_white_is_refused(factor: float, words: str) -> None:
    light = window(0)
    light *= factor / facing_irradiance(light)
    with pytest.raises(CaptureError, match=words):
        capture_from_picture(picture_of(SKIN, light), "webcam")


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "words"), [(0.02, "the face is dark"), (4.0, "% of the skin is white")])
def test_a_dark_or_bright_face_is_used_with_a_warning(factor: float, words: str) -> None:
    light = window(0)
    light *= factor / facing_irradiance(light)
    captured = capture_from_picture(picture_of(SKIN, light), "webcam")
    assert words in captured.warnings[0]
    assert captured.subject.metadata.psnr_db > 20


@pytest.mark.slow
def test_a_matte_without_the_face_is_filled_with_a_warning() -> None:
    light = window(0)
    light *= 0.7 / facing_irradiance(light)
    picture = picture_of(SKIN, light)
    captured = capture_from_picture(replace(picture, matte=np.zeros_like(picture.matte)), "webcam")
    assert "cannot be told from what is behind it" in captured.warnings[0]
    assert captured.subject.matte.max() > 0.99


def test_without_networks_it_says_what_gets_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path))
    with pytest.raises(ModelError, match="relit models pull"):
        capture_instant([np.zeros((240, 320, 3), np.uint8)], "webcam")


@pytest.mark.usefixtures("models")
class TestOnRealPictures:
    """With the networks, on recordings of people."""

    @pytest.mark.slow
    def test_a_clip_gives_a_subject(self, shared: Path) -> None:
        subject = build_instant_subject(frames_of(shared / "driving" / "liveportrait_d0.mp4", 12), "clip.mp4")
        assert subject.size == (256, 256)
        assert subject.metadata.source == "clip.mp4"
        assert subject.metadata.psnr_db > 30
        assert 0.2 < float((subject.matte > 0.5).mean()) < 0.8

    @pytest.mark.slow
    def test_the_picture_is_the_calm_face_of_a_clip_that_ends_in_a_smile(self, shared: Path) -> None:
        subject = build_instant_subject(frames_of(shared / "driving" / "liveportrait_d0.mp4", 12), "clip.mp4")
        points = subject.landmarks["mesh478"]
        width = np.linalg.norm(points[61] - points[291]) / np.linalg.norm(points[33] - points[263])
        assert width < 0.62

    @pytest.mark.slow
    def test_one_picture_is_enough(self, shared: Path) -> None:
        captured = capture_instant([read_display(shared / "portraits" / "uniface_portrait1.jpg")], "portrait")
        assert captured.frames == 1

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("name", "words"),
        [("nobody", "no face"), ("small", "pixels high"), ("profile", "turned away"), ("dark", "too dark"),
         ("white", "over-exposed")],
    )  # fmt: skip
    def test_what_is_no_use_is_refused_in_one_line(self, shared: Path, name: str, words: str) -> None:
        face = read_display(shared / "portraits" / "liveportrait_d30.jpg")
        linear = linear_from_uint8(face)
        pictures = {
            "nobody": lambda: np.full((480, 640, 3), 90, np.uint8),
            "small": lambda: np.asarray(cv2.resize(face, None, fx=0.06, fy=0.06, interpolation=cv2.INTER_AREA)),
            "profile": lambda: frames_of(shared / "driving" / "head-pose-face-detection-female.gif", 23)[3],
            "dark": lambda: uint8_from_linear(linear * np.float32(0.005)),
            "white": lambda: uint8_from_linear(linear * np.float32(6)),
        }
        picture = np.ascontiguousarray(pictures[name]())
        if name == "small":
            picture = np.pad(picture, ((60, 60), (100, 100), (0, 0)), mode="edge")
        with pytest.raises(CaptureError, match=words):
            build_instant_subject([picture], "picture.png")

    @pytest.mark.slow
    def test_two_faces_are_no_error(self, shared: Path) -> None:
        face = read_display(shared / "portraits" / "liveportrait_d30.jpg")
        captured = capture_instant([np.ascontiguousarray(np.hstack([face, face[:, ::-1]]))], "portrait")
        assert captured.warnings[0].startswith("two people")

    @pytest.mark.slow
    def test_a_skull_on_a_sweater_is_no_second_face(self, shared: Path) -> None:
        assert capture_instant(frames_of(shared / "driving" / "asl_yes.mkv", 8), "clip").frames > 1
