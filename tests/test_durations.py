"""What is stored of how long tests took, and the sums of it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.durations import PART_VARIABLE, ROOT, add_durations, by_folder, read_durations


def test_each_part_is_kept_beside_the_others(tmp_path: Path) -> None:
    path = tmp_path / "build" / "durations.json"
    assert read_durations(path) == {}
    add_durations("browser", {"tests/browser/test_a.py::test_b": 1.23456}, path)
    add_durations("units", {"tests/test_c.py::test_d": 2.0}, path)
    add_durations("units", {"tests/test_c.py::test_d": 3.0}, path)
    assert read_durations(path) == {
        "browser": {"tests/browser/test_a.py::test_b": 1.235},
        "units": {"tests/test_c.py::test_d": 3.0},
    }


def test_folders_are_summed_over_parts_the_longest_first() -> None:
    units = {"tests/live/modes/test_a.py::test_b[x/y::z]": 1.0, "tests/live/test_c.py::test_d": 2.0}
    others = {"tests/live/test_c.py::test_e": 3.0, "tests/test_f.py::test_g": 9.0}
    assert by_folder({"units": units, "others": others}) == [("tests", 1, 9.0), ("tests/live", 3, 6.0)]


@pytest.mark.slow
@pytest.mark.parametrize("processes", [(), ("-n", "2", "--dist", "loadgroup")])
def test_a_run_stores_each_test_once(processes: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(
        "import pytest, time\n"
        "@pytest.mark.xdist_group('one')\n"
        "@pytest.mark.parametrize('of', ['a@b', 'c'])\n"
        "def test_that(of): time.sleep(0.2)\n"
    )
    program = (
        "import sys, pytest; from pathlib import Path; from tests import durations\n"
        "durations.FILE = Path('d.json').resolve()\n"
        "sys.exit(pytest.main(sys.argv[1:], plugins=[durations]))"
    )
    command = [sys.executable, "-c", program, "-q", "-p", "no:cacheprovider", f"--rootdir={tmp_path}", *processes, "."]
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "TEST_"))}
    variables = {**kept, PART_VARIABLE: "units", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    stored = read_durations(tmp_path / "d.json")["units"]
    assert stored.keys() == {"test_it.py::test_that[a@b]", "test_it.py::test_that[c]"}
    assert all(took >= 0.2 for took in stored.values())
