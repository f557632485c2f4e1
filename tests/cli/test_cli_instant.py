"""`relit capture instant` and what `relit subject info` tells of it: bad input is one line, and nothing is left."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.images.image_files import write_display
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import captured
from tests.capture.instant.conftest import models, pulled_models
from tests.capture.instant.lit_person import SKIN, picture_of, window
from tests.cli.relit_command import call

__all__ = ["models", "pulled_models"]


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


def test_a_person_comes_out_and_info_tells_the_rung(tmp_path: Path, shared: Path, models: Path) -> None:
    clip = shared / "driving" / "adam_talk.mp4"
    answer = call("capture", "instant", clip, "--out", tmp_path / "me.relit")
    assert answer.code == 0, answer
    assert "me.relit: 256x256" in answer.out
    told = call("subject", "info", tmp_path / "me.relit")
    assert told.out.startswith("instant: captured from a few frames in the light of the room")
    header = json.loads(call("subject", "info", tmp_path / "me.relit", "--json").out)
    assert (header["rung"], header["measured_fraction"], header["source"]) == ("instant", 0.0, "adam_talk.mp4")
    assert header["stills"] >= 4, "somebody who talks and turns shows expressions"
    assert f"{header['stills']} expression stills: " in answer.out


def test_somebody_who_keeps_still_gives_a_subject_without_expression_stills(
    tmp_path: Path, shared: Path, models: Path
) -> None:
    with VideoReader(shared / "driving" / "adam_talk.mp4") as frames:
        first = next(iter(frames)).image
    write_display(tmp_path / "me.png", first)
    with VideoWriter(tmp_path / "me.mp4", (first.shape[1], first.shape[0]), 24.0) as writer:
        for index in range(48):
            writer.write(first, index / 24)
    for name in ("me.png", "me.mp4"):
        answer = call("capture", "instant", tmp_path / name, "--out", tmp_path / "me.relit")
        assert answer.code == 0, answer
        assert "stills" not in answer.out + answer.err


def test_a_picture_without_a_face_leaves_nothing(tmp_path: Path, shared: Path, models: Path) -> None:
    write_display(tmp_path / "wall.png", np.full((240, 320, 3), 128, np.uint8))
    call("capture", "instant", tmp_path / "wall.png", "--out", tmp_path / "me.relit").complains("no face", "wall.png")
    assert left(tmp_path) == ["wall.png"]


def test_info_tells_of_a_subject_whose_rung_nobody_noted(tmp_path: Path) -> None:
    from relit_camera.capture.instant.instant_capture import capture_from_picture

    subject = capture_from_picture(picture_of(SKIN, window(0) * np.float32(0.2)), "webcam").subject
    old = subject.metadata.model_copy(update={"rung": None, "expected_db": None, "measured_fraction": None})
    object.__setattr__(subject, "metadata", old)
    write_subject(tmp_path / "old.relit", subject)
    assert "older version" in call("subject", "info", tmp_path / "old.relit").out


def test_a_better_subject_of_that_name_is_told_before_a_device_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_STORAGE__DATA_DIR", str(tmp_path))
    (tmp_path / "subjects").mkdir()
    write_subject(tmp_path / "subjects" / "instant.relit", captured("film"))
    answer = call("run", "--instant", "--source", tmp_path / "no such film.mp4", "--sink", "null", "--no-pull")
    answer.complains("subject 'instant' was captured in a better way", "--subject instant")
