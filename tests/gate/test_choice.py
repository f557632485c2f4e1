"""Which parts run is told by what has changed since they passed."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.gate.choice import Pass, changed_files, choose, digest, read_passed, this_commit, write_passed
from tests.gate.parts import Part

ALWAYS = Part("unit", "each unit", "1 min")
CAMERA = Part("camera", "the camera", "2 min", about=("camera", ":(exclude,glob)camera/**/*.md"))


def git(root: Path, *arguments: str) -> None:
    who = ("-c", "user.name=A", "-c", "user.email=a@example.org")
    subprocess.run(["git", *who, *arguments], cwd=root, check=True, capture_output=True)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A repository with a file that the part is about, one that it excludes, and another."""
    for name in ("camera/a.py", "camera/a.md", "docs/b.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / ".gitignore").write_text("*.pyc\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "begun")
    return tmp_path


def runs(root: Path, passed: dict[str, Pass], everything: bool = False) -> dict[str, str]:
    """Parts that run, and why."""
    return {each.part.name: each.why for each in choose((ALWAYS, CAMERA), passed, everything, root) if each.runs}


@pytest.fixture
def passed(root: Path) -> dict[str, Pass]:
    """All parts have passed."""
    return {"camera": Pass(this_commit(root), digest(CAMERA.about, root))}


def test_what_is_not_on_record_runs(root: Path) -> None:
    assert runs(root, {}) == {"unit": "always", "camera": "no pass is on record"}


def test_a_part_is_left_out_while_nothing_it_is_about_changes(root: Path, passed: dict[str, Pass]) -> None:
    for other in ("docs/b.md", "camera/a.md", "camera/c.pyc", "new.py"):
        (root / other).write_text("changed")
    assert runs(root, passed) == {"unit": "always"}
    (left_out,) = [each for each in choose((ALWAYS, CAMERA), passed, root=root) if not each.runs]
    assert left_out.why.endswith(passed["camera"].commit)


@pytest.mark.parametrize("name", ["camera/a.py", "camera/new.py"])
@pytest.mark.parametrize("committed", [False, True], ids=["in the folder", "committed"])
def test_a_change_makes_it_run(name: str, committed: bool, root: Path, passed: dict[str, Pass]) -> None:
    (root / name).write_text("changed")
    if committed:
        git(root, "add", ".")
        git(root, "commit", "-qm", "changed")
    assert runs(root, passed)["camera"] == f"changed since {passed['camera'].commit}: {name}"


def test_a_file_that_is_renamed_or_gone_makes_it_run(root: Path, passed: dict[str, Pass]) -> None:
    git(root, "mv", "camera/a.py", "camera/b.py")
    assert "camera" in runs(root, passed)
    (root / "camera/b.py").unlink()
    assert "camera" in runs(root, passed)


def test_a_change_taken_back_leaves_it_out_again(root: Path, passed: dict[str, Pass]) -> None:
    (root / "camera/a.py").write_text("changed")
    (root / "camera/a.py").write_text("camera/a.py")
    assert "camera" not in runs(root, passed)


def test_all_run_where_all_are_asked_for(root: Path, passed: dict[str, Pass]) -> None:
    assert set(runs(root, passed, everything=True)) == {"unit", "camera"}


def test_a_commit_that_git_does_not_know_is_no_hindrance(root: Path, passed: dict[str, Pass]) -> None:
    """As in a shallow clone, or after a rebase: the digest tells."""
    unknown = {"camera": Pass("0123456789", passed["camera"].digest)}
    assert "camera" not in runs(root, unknown)
    (root / "camera/a.py").write_text("changed")
    assert runs(root, unknown)["camera"] == "files have changed"
    assert changed_files(CAMERA.about, "0123456789", root) == []


def test_what_has_passed_is_read_as_written(tmp_path: Path) -> None:
    path = tmp_path / "passed.json"
    assert read_passed(path) == {}
    passed = {"b": Pass("1", "2"), "a": Pass("3-dirty", "4")}
    write_passed(passed, path)
    assert read_passed(path) == passed


def test_a_commit_with_changes_is_called_so(root: Path) -> None:
    assert "-dirty" not in this_commit(root)
    (root / "camera/a.py").write_text("changed")
    assert this_commit(root).endswith("-dirty")


def test_without_git_it_says_so(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="is no git repository"):
        digest(["."], tmp_path)
    assert this_commit(tmp_path) == "unknown"
