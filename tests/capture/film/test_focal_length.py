"""The focal length, and the tag it may be read from, in files put together here."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import InputError, VideoError
from relit_camera.capture.film.focal_length import (
    focal_length_from_option,
    focal_length_from_tag,
    read_focal_length_tag,
    typical_focal_length,
)

KEY = b"com.apple.quicktime.camera.focal_length.35mm_equivalent"


def box(kind: bytes, *contents: bytes) -> bytes:
    body = b"".join(contents)
    return struct.pack(">I4s", 8 + len(body), kind) + body


def metadata(value: bytes, kind: int, full: bool = False) -> bytes:
    """A `meta` box with two keys, the second the focal length; a full box, as MP4 has it, begins with flags."""
    names = [b"com.apple.quicktime.make", KEY]
    keys = box(b"keys", struct.pack(">II", 0, 2), *(box(b"mdta", name) for name in names))
    data = [box(b"data", struct.pack(">II", t, 0), v) for t, v in ((1, b"Apple"), (kind, value))]
    items = box(b"ilst", *(box(struct.pack(">I", i + 1), part) for i, part in enumerate(data)))
    handler = box(b"hdlr", bytes(24))
    return box(b"meta", *([bytes(4)] if full else []), handler, keys, items)


def movie(path: Path, *parts: bytes) -> Path:
    path.write_bytes(box(b"ftyp", b"qt  ", bytes(4)) + box(b"mdat", bytes(3000)) + box(b"moov", *parts))
    return path


@pytest.mark.parametrize(
    ("value", "kind", "expected"),
    [(b"26", 1, 26.0), (b"50.00mm", 1, 50.0), (b"\x1a", 21, 26.0), (struct.pack(">f", 24.0), 23, 24.0)],
)
def test_the_tag_of_a_track_or_the_file(tmp_path: Path, value: bytes, kind: int, expected: float) -> None:
    header = box(b"tkhd", bytes(80))
    assert read_focal_length_tag(movie(tmp_path / "a.mov", box(b"trak", header, metadata(value, kind)))) == expected
    assert read_focal_length_tag(movie(tmp_path / "b.mp4", metadata(value, kind, full=True))) == expected


@pytest.mark.parametrize("value", [b"", b"wide", b"0", b"-5mm", b"99999"])
def test_implausible_values_are_ignored(tmp_path: Path, value: bytes) -> None:
    assert read_focal_length_tag(movie(tmp_path / "a.mov", metadata(value, 1))) is None


def test_files_without_a_tag(tmp_path: Path) -> None:
    assert read_focal_length_tag(movie(tmp_path / "a.mov", box(b"mvhd", bytes(100)))) is None
    for name, contents in {"empty": b"", "other": b"RIFF" + bytes(500), "zeros": bytes(5000)}.items():
        (tmp_path / name).write_bytes(contents)
        assert read_focal_length_tag(tmp_path / name) is None
    whole = movie(tmp_path / "whole.mov", metadata(b"26", 1)).read_bytes()
    for length in range(3020, len(whole), 7):  # cut off anywhere in the header
        (tmp_path / "cut.mov").write_bytes(whole[:length])
        assert read_focal_length_tag(tmp_path / "cut.mov") in (None, 26.0)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match=r"missing\.mov"):
        read_focal_length_tag(tmp_path / "missing.mov")


def test_pixels_of_an_equivalent_focal_length() -> None:
    # 36x24 mm film itself: a 50 mm lens before 3600x2400 pixels.
    focal = focal_length_from_tag(50.0, (3600, 2400))
    assert focal.pixels == pytest.approx(5000, rel=1e-3)
    assert "50 mm" in focal.source


def test_a_given_focal_length_is_more_accurate_than_a_guess() -> None:
    given, guess = focal_length_from_option(800), typical_focal_length((540, 960))
    assert given.error < guess.error
    assert given.source == "given"
    assert "guess" in guess.source
    # Phones film with about 65 degrees along the picture's longer side.
    assert 2 * np.degrees(np.arctan(480 / guess.pixels)) == pytest.approx(64, abs=4)


@pytest.mark.parametrize("pixels", [0.0, -3.0, float("nan"), float("inf")])
def test_an_impossible_focal_length_is_refused(pixels: float) -> None:
    with pytest.raises(InputError, match="impossible"):
        focal_length_from_option(pixels)
