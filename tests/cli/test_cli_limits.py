"""Files that are too large or too deep for what they are: one line, exit 1."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import SubjectError
from relit_camera.subject.compression.webp_packing import decode_basis
from relit_camera.subject.subject_file import HEADER_KEY, read_subject
from tests import bad_pictures as bad
from tests.cli.relit_command import call

LAUGHS = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [{','.join(['*' + chr(97 + i)] * 9)}]\n" for i in range(9)
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAUGHS, "aliases"),
        ("look:\n  lighting: &l {}\nsubject: *l\n", "line 3: aliases"),
        ("[" * 100_000, "nested more than 32 deep"),
        ("subject: " + "9" * 5000, "a number of more than 40 characters"),
        ("output: {width: 2001-01-01}", "output.width"),
        ("#" * ((1 << 20) + 1), "larger than 1 MiB"),
        ("!!python/object/apply:os.system [id]", "tags"),
        ("1: 2", "1: Extra inputs"),
    ],
    ids=["billion laughs", "alias", "deep", "number", "date", "large", "object", "number as key"],
)
def test_a_configuration_that_means_harm(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    call("--config", path, "config", "check").complains(said)


def test_a_list_of_lights_that_is_too_large(tmp_path: Path) -> None:
    path = tmp_path / "lights.lp"
    path.write_bytes(b"4\n" + b"a.png 0 0 1\n" * 400_000)
    call("capture", "import", path, "--out", tmp_path / "a.relit").complains("larger than 4 MiB")
    assert not (tmp_path / "a.relit").exists()


def test_a_track_that_is_too_large(tmp_path: Path) -> None:
    path = tmp_path / "track.json"
    with path.open("wb") as file:
        file.truncate((512 << 20) + 1)
    call("run", "--source", "pattern", "--sink", "null", "--port", 0, "--tracker", f"recorded:{path}").complains(
        "larger than 512 MiB"
    )


def relit(path: Path, header: bytes, size: int | None = None) -> Path:
    path.write_bytes(struct.pack("<Q", len(header) if size is None else size) + header)
    return path


@pytest.mark.parametrize(
    ("header", "size"),
    [
        (b"{}", 1 << 62),
        (b"[" * 1000, None),
        (json.dumps({"__metadata__": {HEADER_KEY: "[" * 100_000}}).encode(), None),
        (json.dumps({"matte": {"dtype": "F32", "shape": [1 << 40, 1 << 40], "data_offsets": [0, 4]}}).encode(), None),
        (json.dumps({"matte": {"dtype": "F32", "shape": [1], "data_offsets": [0, 1 << 60]}}).encode(), None),
    ],
    ids=["header of 2^62 bytes", "nested", "our header nested", "2^80 values", "beyond its end"],
)
def test_a_subject_that_means_harm(tmp_path: Path, header: bytes, size: int | None) -> None:
    with pytest.raises(SubjectError) as caught:
        read_subject(relit(tmp_path / "a.relit", header, size))
    assert "\n" not in str(caught.value)


def test_a_subject_s_picture_must_be_of_its_size() -> None:
    """Before it is decoded: the picture's header may state 16383 pixels a side."""
    bomb = np.frombuffer(bad.webp_of_size(16383, 16383), np.uint8)
    with pytest.raises(SubjectError, match="cannot be decoded"):
        decode_basis(bomb, (3, 1, 32, 64))
