"""Writing whole or not at all, and sweeping up after killed writers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from relit_camera.base.errors import StorageError
from relit_camera.base.storage.atomic_files import atomic_path, remove_unfinished_files, write_atomic

WRITER = """
import sys
from pathlib import Path
from relit_camera.base.storage import atomic_path
with atomic_path(Path(sys.argv[1])) as temporary:
    temporary.write_bytes(b"half")
    print("at work", flush=True)
    sys.stdin.read()
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def killed_writer(target: Path) -> subprocess.Popen[str]:
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(target)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert writer.stdout is not None
    assert writer.stdout.readline() == "at work\n"
    return writer


def test_a_file_comes_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "a.yaml"
    write_atomic(target, "old")
    with suppress(KeyboardInterrupt), atomic_path(target) as temporary:
        temporary.write_text("new")
        assert target.read_text() == "old"
        raise KeyboardInterrupt
    assert target.read_text() == "old"
    write_atomic(target, "new")
    assert target.read_text() == "new"
    assert names(tmp_path) == ["a.yaml"]


@pytest.mark.skipif(os.name != "posix", reason="modes are of POSIX")
def test_files_get_their_mode_when_created_and_the_umask_is_never_touched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = os.umask(0o027)
    try:
        monkeypatch.setattr(os, "umask", lambda _: pytest.fail("other threads would create files without a mask"))
        with atomic_path(tmp_path / "a.yaml") as temporary:
            assert temporary.stat().st_mode & 0o777 == 0o640
            temporary.write_text("x")
        assert (tmp_path / "a.yaml").stat().st_mode & 0o777 == 0o640
    finally:
        monkeypatch.undo()
        os.umask(before)


def test_file_and_folder_are_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(str(Path(f"/proc/self/fd/{handle}").readlink())))
    write_atomic(tmp_path / "a.yaml", "text")
    assert len(synced) == 2
    assert ".unfinished-" in synced[0]
    assert synced[1] == str(tmp_path)


def test_what_a_killed_writer_leaves_is_swept_and_what_a_living_one_writes_is_not(tmp_path: Path) -> None:
    writer = killed_writer(tmp_path / "a.yaml")
    try:
        assert len(names(tmp_path)) == 1
        assert remove_unfinished_files(tmp_path) == []
    finally:
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
    [left] = names(tmp_path)
    assert left.startswith(".a.unfinished-")
    assert left.endswith(".yaml")
    assert [path.name for path in remove_unfinished_files(tmp_path)] == [left]
    assert names(tmp_path) == []


def test_what_was_made_just_now_is_left_alone(tmp_path: Path) -> None:
    """Between making and locking it a writer has no lock yet."""
    path = tmp_path / ".a.unfinished-abcdefgh.hdr"
    path.touch()
    assert remove_unfinished_files(tmp_path) == []
    os.utime(path, (1, 1))
    assert remove_unfinished_files(tmp_path) == [path]


def test_nothing_else_is_swept(tmp_path: Path) -> None:
    others = [".hidden", ".a.abcdefgh.hdr", "a.unfinished-abcdefgh.hdr", ".a.unfinished-x.hdr", "a.hdr"]
    for name in others:
        (tmp_path / name).write_bytes(b"x")
    outside = tmp_path / "a.hdr"
    (tmp_path / ".b.unfinished-abcdefgh.hdr").symlink_to(outside)
    assert remove_unfinished_files(tmp_path) == []
    assert outside.read_bytes() == b"x"
    assert set(others) < set(names(tmp_path))


def test_a_folder_that_is_not_there_is_no_error(tmp_path: Path) -> None:
    assert remove_unfinished_files(tmp_path / "none") == []


def test_a_folder_without_rights_is_said(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="cannot write"):
        write_atomic(tmp_path / "none" / "a.yaml", "text")
