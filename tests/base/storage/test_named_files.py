"""A folder of files found by name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from relit_camera.base.errors import InputError, NotFoundError, StorageError
from relit_camera.base.storage.named_files import NamedFiles, file_version, is_valid_name


@pytest.fixture
def files(tmp_path: Path) -> NamedFiles:
    return NamedFiles(tmp_path / "store", "tune", [".flac", ".mid"], frozenset({"silence"}))


def stored(files: NamedFiles) -> list[str]:
    return sorted(path.name for path in files.folder.iterdir())


def test_a_written_file_is_found_replaced_and_removed(files: NamedFiles) -> None:
    assert files.names() == []
    files.write("march", ".mid", "old")
    files.write("aria", ".mid", b"\0")
    assert files.names() == ["aria", "march"]
    files.write("march", ".mid", "new")
    assert files.path("march").read_text() == "new"
    files.remove("march")
    assert stored(files) == ["aria.mid"]


def test_a_replacement_with_another_suffix_leaves_one_file(files: NamedFiles) -> None:
    files.write("march", ".flac", "first")
    files.write("march", ".mid", "second")
    assert stored(files) == ["march.mid"]


def test_a_failed_replacement_leaves_what_was(files: NamedFiles) -> None:
    files.write("march", ".flac", "old")
    with suppress(ValueError), files.replacing("march", ".mid") as temporary:
        temporary.write_text("half")
        raise ValueError
    assert stored(files) == ["march.flac"]
    assert files.path("march").read_text() == "old"


def test_of_two_files_with_one_name_the_first_suffix_counts_and_both_are_removed(files: NamedFiles) -> None:
    """A crash between writing one and deleting the other leaves both."""
    files.write("march", ".mid", "m")
    (files.folder / "march.FLAC").write_text("f")
    assert files.names() == ["march"]
    assert files.path("march").read_text() == "f"
    files.remove("march")
    assert stored(files) == []


@pytest.mark.parametrize("name", ["../evil", "a/b", "/etc/passwd", ".hidden", "silence", "notes", "bad*name"])
def test_only_named_files_of_the_folder_are_found(files: NamedFiles, name: str) -> None:
    files.write("march", ".mid", "m")
    for other in ("../evil.mid", ".hidden.mid", "silence.mid", "notes.txt", "bad*name.mid"):
        (files.folder / other).write_text("x")
    assert files.names() == ["march"]
    with pytest.raises(NotFoundError, match="no tune"):
        files.path(name)
    with pytest.raises(NotFoundError, match="no tune"):
        files.remove(name)


def test_names_of_files_put_there_by_hand_may_be_allowed(files: NamedFiles) -> None:
    files.write("march", ".mid", "m")
    (files.folder / "Frühling (2).mid").write_text("x")
    assert files.names() == ["march"]
    assert NamedFiles(files.folder, "tune", [".mid"], any_name=True).names() == ["Frühling (2)", "march"]


@pytest.mark.parametrize("name", ["", ".hidden", "../evil", "a/b", "a\\b", "x" * 65, "é", "-dash", "a\n", "a.", "con"])
def test_names_that_are_not_safe_everywhere_are_refused(files: NamedFiles, name: str) -> None:
    assert not is_valid_name(name)
    with pytest.raises(InputError, match="cannot name a tune"):
        files.write(name, ".mid", "m")
    assert not files.folder.exists()


def test_reserved_names_are_refused(files: NamedFiles) -> None:
    with pytest.raises(InputError, match="'silence' is a reserved name"):
        files.write("silence", ".mid", "m")


def test_the_error_offers_similar_names_or_all(files: NamedFiles) -> None:
    with pytest.raises(NotFoundError, match="no tune 'march'; there are: none"):
        files.path("march")
    files.write("march", ".mid", "m")
    files.write("aria", ".mid", "m")
    with pytest.raises(NotFoundError, match="no tune 'marsh'; did you mean 'march'\\?"):
        files.path("marsh")
    with pytest.raises(NotFoundError, match="no tune 'x'; there are: aria, march"):
        files.path("x")


ENVIRONMENTS = ("studio", "window", "sunset", "night-street", "party", "overcast")


@pytest.fixture
def environments(tmp_path: Path) -> NamedFiles:
    made = NamedFiles(tmp_path / "environments", "environment", [".hdr"])
    for name in ENVIRONMENTS:
        made.write(name, ".hdr", "x")
    return made


def slips(name: str) -> Iterator[str]:
    """What a hand makes of a name: a letter lost, doubled, replaced, two swapped; upper case, another dash, an end."""
    for at, letter in enumerate(name):
        yield name[:at] + name[at + 1 :]
        yield name[:at] + letter + name[at:]
        yield name[:at] + "e" + name[at + 1 :]
        yield name[:at] + name[at + 1 : at + 2] + letter + name[at + 2 :]
    yield from (name.upper(), name.capitalize(), f"{name}s", f"the {name}", f"{name}.hdr", name[: len(name) // 2 + 1])
    yield from (name.replace("-", other) for other in (" ", "", "_"))


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_a_slip_of_the_hand_is_understood(name: str, environments: NamedFiles) -> None:
    for slip in set(slips(name)) - {name}:
        with pytest.raises(NotFoundError, match=f"did you mean '{name}'"):
            environments.path(slip)


@pytest.mark.parametrize("name", ["library", "forest", "night-club", "bar", "desert", "day", "beach", "church", "me"])
def test_another_word_is_no_slip(name: str, environments: NamedFiles) -> None:
    with pytest.raises(NotFoundError, match=f"no environment '{name}'; there are: night-street, overcast"):
        environments.path(name)


def test_a_folder_that_cannot_be_created_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    files = NamedFiles(tmp_path / "file" / "store", "tune", [".mid"])
    assert files.names() == []
    with pytest.raises(StorageError, match="cannot write"):
        files.write("march", ".mid", "m")


def test_a_file_that_cannot_be_deleted_is_said(files: NamedFiles) -> None:
    (files.folder / "march.mid").mkdir(parents=True)
    with pytest.raises(StorageError, match=r"cannot delete .*march\.mid"):
        files.remove("march")


def test_the_version_changes_with_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text("one")
    os.utime(path, ns=(1, 1))
    first = file_version(path)
    assert file_version(path) == first
    path.write_text("two")
    assert file_version(path) != first
