"""The checkpoint of a build: read back bit by bit, or deleted."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, StorageError, VideoError
from relit_camera.capture.film.ball.sphere_projection import BallOutline
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.film.pipeline.checkpoint import (
    SAMPLES_FILE_NAME,
    Checkpoint,
    CheckpointFolder,
    input_fingerprint,
)
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from tests.capture.film.generated_film import write_film

OPTIONS = CaptureOptions(ball=BallOutline(1.5, 2, 3), face=FaceCircle(4, 5, 6))


@pytest.fixture
def found() -> Checkpoint:
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(3, 3))
    pictures = rng.normal(size=(3, 4, 5, 3)).astype(np.float32)
    # Fortran's order: what is written is in C's.
    matte = np.asfortranarray(rng.uniform(size=(4, 5)).astype(np.float32))
    return Checkpoint(
        OlatSamples(pictures, directions, matte), {"warnings": ["é"], "focal_px": 0.1 + 0.2, "list": [1, None]}
    )


@pytest.fixture
def messages() -> list[str]:
    return []


@pytest.fixture
def kept(tmp_path: Path, messages: list[str]) -> CheckpointFolder:
    return CheckpointFolder(tmp_path / "me.relit", "this film", messages.append)


def test_what_was_written_is_read_again_bit_by_bit(
    kept: CheckpointFolder, found: Checkpoint, messages: list[str], tmp_path: Path
) -> None:
    assert kept.read() is None
    assert not messages
    kept.write(found)
    again = CheckpointFolder(tmp_path / "me.relit", "this film", messages.append).read()
    assert again is not None
    for name in ("pictures", "directions", "matte"):
        value, expected = getattr(again.samples, name), getattr(found.samples, name)
        assert value.dtype == expected.dtype
        np.testing.assert_array_equal(value, expected)
    assert again.report == found.report
    assert messages == [f"going on from {tmp_path / 'me.relit.partial'}, where the last build was broken off"]


def test_the_folder_is_private(kept: CheckpointFolder, found: Checkpoint) -> None:
    kept.folder.mkdir(mode=0o755)
    kept.write(found)
    assert kept.folder.stat().st_mode & 0o777 == 0o700


def test_a_checkpoint_of_another_film_is_deleted(
    kept: CheckpointFolder, found: Checkpoint, messages: list[str], tmp_path: Path
) -> None:
    kept.write(found)
    assert CheckpointFolder(tmp_path / "me.relit", "another", messages.append).read() is None
    assert "is of another film, other options or another version: starting over" in messages[0]
    assert not kept.folder.exists()


def _cut_off(data: bytes) -> bytes:
    return data[:-40]


def _one_bit_of_a_picture(data: bytes) -> bytes:
    return data[:-9] + bytes([data[-9] ^ 1]) + data[-8:]


def _one_letter_of_the_report(data: bytes) -> bytes:
    return data.replace(b"focal_px", b"focal_py")


@pytest.mark.parametrize(
    "spoil", [_cut_off, _one_bit_of_a_picture, _one_letter_of_the_report, lambda data: b"", lambda data: b"{}" * 99]
)
def test_a_damaged_checkpoint_is_deleted(
    spoil: Callable[[bytes], bytes], kept: CheckpointFolder, found: Checkpoint, messages: list[str]
) -> None:
    kept.write(found)
    file = kept.folder / SAMPLES_FILE_NAME
    file.write_bytes(spoil(file.read_bytes()))
    assert kept.read() is None
    assert messages == [f"what lies in {kept.folder} is damaged: starting over"]
    assert not kept.folder.exists()


def test_the_fingerprint_depends_on_content_and_options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    codes = np.arange(12, dtype=np.uint8)[:, None, None, None] * np.ones((64, 64, 3), np.uint8)
    film, other = (write_film(tmp_path / name, codes + add) for name, add in (("a.mp4", 0), ("b.mp4", 9)))
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path))
    first = input_fingerprint(film, OPTIONS)
    film.touch()
    assert input_fingerprint(film, replace(OPTIONS)) == first
    assert json.loads(first)
    assert input_fingerprint(film, replace(OPTIONS, near_field=False)) != first
    assert input_fingerprint(film, replace(OPTIONS, ball=BallOutline(1.5, 2, 3.5))) != first
    film.write_bytes(other.read_bytes())
    assert input_fingerprint(film, OPTIONS) != first
    with pytest.raises(VideoError, match="no video at"):
        input_fingerprint(tmp_path / "none.mp4", OPTIONS)


@pytest.mark.parametrize(
    ("end", "stays"),
    [(None, False), (CaptureError("no ball"), False), (StorageError("full"), True), (KeyboardInterrupt(), True),
     (SystemExit(143), True), (MemoryError(), True)],
)  # fmt: skip
def test_a_checkpoint_is_kept_where_the_build_could_resume(
    end: BaseException | None, stays: bool, kept: CheckpointFolder, found: Checkpoint, messages: list[str]
) -> None:
    def build() -> None:
        with kept.keep_until_done():
            kept.write(found)
            if end:
                raise end

    if end:
        with pytest.raises(type(end)):
            build()
    else:
        build()
    assert kept.folder.exists() == stays
    broken_off = isinstance(end, KeyboardInterrupt | SystemExit)
    assert messages == [f"kept in {kept.folder}: the same command goes on from there, --fresh starts over"] * broken_off


def test_only_own_files_are_deleted(kept: CheckpointFolder, found: Checkpoint) -> None:
    kept.write(found)
    (kept.folder / ".samples.half.safetensors").touch()
    (kept.folder / "diary.txt").touch()
    kept.remove()
    assert [path.name for path in kept.folder.iterdir()] == ["diary.txt"]


def test_without_a_writable_checkpoint_the_build_goes_on(
    kept: CheckpointFolder, found: Checkpoint, messages: list[str]
) -> None:
    kept.folder.write_text("a file of that name")
    kept.write(found)
    assert len(messages) == 1
    assert messages[0].startswith("warning: if broken off, this build cannot go on: cannot write")
    assert kept.folder.read_text() == "a file of that name"
