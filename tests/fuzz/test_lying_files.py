"""Every file that once did harm is refused, or read, within 64 MiB and a second, and leaves nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from relit_camera.base.errors import InputError
from tests.fuzz.judging import Judge
from tests.fuzz.lying_files import FINDS
from tests.fuzz.readers import READERS

READ = {
    "png with a packed comment",
    "png, animated",
    "mp4 whose title is no UTF-8",
    "mkv whose title is no UTF-8",
}
"""Those in which what matters is sound."""


@pytest.fixture(scope="module")
def judge() -> Iterator[Judge]:
    with Judge() as one:
        yield one


@pytest.mark.slow
@pytest.mark.parametrize("name", FINDS)
def test_a_file_that_lies_takes_little_memory_and_time(judge: Judge, tmp_path: Path, name: str) -> None:
    file = FINDS[name]
    path = tmp_path / f"a{file.suffix}"
    path.write_bytes(file.make())
    assert judge.judge(file.kind, file.suffix, path.read_bytes()) == []
    for read in READERS[file.kind]:
        if name in READ:
            read(path)
        else:
            with pytest.raises((InputError, ValueError)):
                read(path)


@pytest.mark.slow
def test_what_is_judged_is_memory_time_files_and_errors(judge: Judge) -> None:
    found = " ".join(judge.judge("harmful", ".txt", b""))
    for wrong in ("ZeroDivisionError", "MiB", " s", "left behind b.txt", "a file is left open"):
        assert wrong in found
    assert judge.judge("deadly", ".txt", b"") == ["the process died (7)"]
