"""`relit capture instant` and what `relit subject info` tells of it: bad input is one line, and nothing is left."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.app.demo import demo_files
from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_files import write_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.capture.instant import frame_reading, median_picture
from relit_camera.devices.sources.source import Source
from relit_camera.devices.sources.webcam_source import WebcamSource
from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import captured
from tests.capture.instant.conftest import models, pulled_models
from tests.cli.relit_command import call
from tests.devices.fake_devices import FakeCapture, FakeTree

pytestmark = pytest.mark.slow

__all__ = ["models", "pulled_models"]


TURNED = 57
"""A frame of the bundled person's film in which they look aside, by 28 degrees."""


@cache
def film_frames() -> list[DisplayImage]:
    """The bundled person's film."""
    with VideoReader(demo_files.CLIP) as frames:
        return [frame.image for frame in frames]


def left(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("nowhere.mp4", ["there is no file", "nowhere.mp4"]),
        ("no-such-camera", ["no-such-camera"]),
    ],
)
def test_what_is_not_there_is_named(tmp_path: Path, source: str, words: list[str]) -> None:
    call("capture", "instant", source, "--out", tmp_path / "me.relit").complains(*words)
    assert left(tmp_path) == []


def test_a_file_that_is_no_picture_is_named(tmp_path: Path) -> None:
    (tmp_path / "me.png").write_bytes(b"no picture")
    call("capture", "instant", tmp_path / "me.png", "--out", tmp_path / "me.relit").complains("me.png")
    assert left(tmp_path) == ["me.png"]


def test_where_nothing_can_be_written_it_says_so_at_once(tmp_path: Path) -> None:
    write_display(tmp_path / "me.png", np.zeros((64, 64, 3), np.uint8))
    call("capture", "instant", tmp_path / "me.png", "--out", tmp_path / "no" / "me.relit").complains("cannot write")


def test_a_person_comes_out_and_info_tells_the_rung(tmp_path: Path, models: Path) -> None:
    answer = call("capture", "instant", demo_files.CLIP, "--out", tmp_path / "me.relit")
    assert answer.code == 0, answer
    assert "me.relit: 256x256" in answer.out
    told = call("subject", "info", tmp_path / "me.relit")
    assert told.out.startswith("instant: captured from a few frames in the light of the room")
    header = json.loads(call("subject", "info", tmp_path / "me.relit", "--json").out)
    assert (header["rung"], header["measured_fraction"], header["source"]) == ("instant", 0.0, demo_files.CLIP.name)
    assert header["stills"] >= 4, "somebody who talks and turns shows expressions"
    assert f"{header['stills']} expression stills: " in answer.out


def test_somebody_who_keeps_still_gives_a_subject_without_expression_stills(
    tmp_path: Path, models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(median_picture, "SIDE_PX", median_picture.MIN_SIDE_PX)  # quicker
    first = film_frames()[0]
    write_display(tmp_path / "me.png", first)
    with VideoWriter(tmp_path / "me.mp4", (first.shape[1], first.shape[0]), 24.0) as writer:
        for index in range(48):
            writer.write(first, index / 24)
    for name in ("me.png", "me.mp4"):
        answer = call("capture", "instant", tmp_path / name, "--out", tmp_path / "me.relit")
        assert answer.code == 0, answer
        assert "stills" not in answer.out + answer.err


def in_light(picture: DisplayImage, factor: float) -> DisplayImage:
    """The picture in that many times the light."""
    return uint8_from_linear(linear_from_uint8(picture) * np.float32(factor))


def far_away(picture: DisplayImage) -> DisplayImage:
    """The picture of somebody who stands seven times as far away, before a wall."""
    height, width = picture.shape[:2]
    small = np.asarray(cv2.resize(picture, (width // 7, height // 7), interpolation=cv2.INTER_AREA))
    aside = (width // 2 - width // 7) // 2
    room = ((height // 2 - height // 7, 0), (aside, aside), (0, 0))
    return np.pad(small, room, mode="edge")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nobody", "no face was found"),
        ("far away", "pixels high, at least 45 are needed"),
        ("dark", "it is too dark"),
        ("white", "over-exposed"),
    ],
)
@pytest.mark.parametrize("suffix", [".png", ".mkv"])
def test_what_is_no_use_is_one_line_and_nothing_is_left(
    tmp_path: Path, models: Path, name: str, words: str, suffix: str
) -> None:
    face = film_frames()[0]
    pictures: dict[str, Callable[[], DisplayImage]] = {
        "nobody": lambda: np.full_like(face, 128),
        "far away": lambda: far_away(face),
        "dark": lambda: in_light(face, 0.01),
        "white": lambda: in_light(face, 6),
    }
    picture, source = np.ascontiguousarray(pictures[name]()), tmp_path / f"me{suffix}"
    if suffix == ".png":
        write_display(source, picture)
    else:
        with VideoWriter(source, (picture.shape[1], picture.shape[0]), 10.0) as film:
            for index in range(3):
                film.write(picture, index / 10)
    call("capture", "instant", source, "--out", tmp_path / "me.relit").complains(words, source.name)
    assert left(tmp_path) == [source.name]


def test_somebody_turned_aside_beside_another_is_used_with_warnings(tmp_path: Path, models: Path) -> None:
    turned = film_frames()[TURNED]
    write_display(tmp_path / "me.png", np.hstack([turned, turned[:, ::-1]]))
    answer = call("capture", "instant", tmp_path / "me.png", "--out", tmp_path / "me.relit")
    assert answer.code == 0, answer
    assert "warning: two people are in the picture" in answer.err
    assert "warning: the face is turned by 2" in answer.err


def test_a_webcam_that_another_program_holds_is_told_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The device is there, and cannot be opened for filming; the virtual machine's tests try a real one."""
    tree = FakeTree(tmp_path / "system")
    tree.add_webcam(0, "HD Webcam")

    def open_busy(settings: SourceSettings) -> Source:
        size = (settings.width, settings.height)
        return WebcamSource(
            settings.source, size, settings.fps, tree=tree, open_capture=lambda *asked: FakeCapture(opened=False)
        )

    monkeypatch.setattr(frame_reading, "read_frames", partial(frame_reading.read_frames, open_live=open_busy))
    monkeypatch.setattr(frame_reading, "TUNABLES", replace(frame_reading.TUNABLES, first_frame_s=1.0))
    answer = call("capture", "instant", "HD Webcam", "--out", tmp_path / "me.relit")
    answer.complains("HD Webcam cannot be opened: another program may be using it", "close the program")
    assert left(tmp_path) == ["system"]


def test_info_tells_of_a_subject_whose_rung_nobody_noted(tmp_path: Path) -> None:
    write_subject(tmp_path / "old.relit", captured(None))
    assert "older version" in call("subject", "info", tmp_path / "old.relit").out


def test_a_better_subject_of_that_name_is_told_before_a_device_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_STORAGE__DATA_DIR", str(tmp_path))
    (tmp_path / "subjects").mkdir()
    write_subject(tmp_path / "subjects" / "instant.relit", captured("film"))
    answer = call("run", "--instant", "--source", tmp_path / "no such film.mp4", "--sink", "null", "--no-pull")
    answer.complains("subject 'instant' was captured in a better way", "--subject instant")
