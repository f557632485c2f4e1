"""Material is made once in a test run, and a module's fixtures are too."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import pytest

from tests.made_once import FOLDER_VARIABLE, WEEK_S, made_once, run_folder


@pytest.fixture(autouse=True)
def own_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))


def test_who_asks_at_the_same_time_waits_for_the_one_that_is_made() -> None:
    made, found = list[Path](), list[Path]()
    started = threading.Barrier(3)

    def make(path: Path) -> None:
        made.append(path)
        path.mkdir()
        (path / "inside.txt").write_text("whole")

    def ask() -> None:
        started.wait(10)
        found.append(made_once("some folder", make))

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10)
    assert len(made) == 1
    assert found == [run_folder() / "some folder"] * 3
    assert (found[0] / "inside.txt").read_text() == "whole"


def test_what_is_kept_is_made_anew_when_a_maker_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    monkeypatch.setattr("tests.made_once.KEPT", tmp_path / "kept")
    makers = dict.fromkeys(["service/a"], "1")
    monkeypatch.setattr("tests.made_once.digest", lambda paths: "".join(makers[path] for path in paths))
    path = made_once("file.txt", lambda path: path.write_text("first"), makers)
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path_factory.mktemp("another run")))
    assert made_once("file.txt", lambda path: path.write_text("second"), makers).read_text() == "first"
    makers["service/a"] = "2"
    assert made_once("file.txt", lambda path: path.write_text("third"), makers).read_text() == "third"
    assert path.exists()


def test_what_nobody_has_used_for_a_week_is_forgotten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.made_once.KEPT", tmp_path / "kept")
    monkeypatch.setattr("tests.made_once.digest", "".join)
    old, newer = (made_once("file.txt", Path.touch, [maker]) for maker in ("1", "2"))
    for path, age_s in ((old, WEEK_S + 60), (newer, WEEK_S - 3600)):
        os.utime(path.with_name("file.txt.lock"), (time.time() - age_s,) * 2)
    made_once("file.txt", Path.touch, ["3"])
    assert (old.exists(), newer.exists()) == (False, True)


def test_what_failed_half_way_is_made_anew() -> None:
    def fail(path: Path) -> None:
        path.write_text("half")
        raise OSError("no more space")

    with pytest.raises(OSError, match="no more space"):
        made_once("file.txt", fail)
    assert made_once("file.txt", lambda path: path.write_text("whole")).read_text() == "whole"


def test_the_tests_of_a_module_run_in_one_process(request: pytest.FixtureRequest) -> None:
    """Else each process of `pytest -n 2` makes the module's fixtures, and tests in real time slow each other."""
    grouped = bool(request.config.getoption("loadgroup", False))
    assert request.node.nodeid.endswith("@tests/test_made_once.py") is grouped
