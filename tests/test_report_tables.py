"""Rows that tests note reach the table at the end of the run, from several processes too."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTES = """
import pytest

@pytest.mark.parametrize("name", ["b", "a"])
def test_a_fault(note_row, name):
    note_row("faults survived", (name, "7 ms", "1 s"))
"""


@pytest.mark.slow
@pytest.mark.parametrize("processes", [0, 2])
def test_rows_are_printed_sorted(tmp_path: Path, processes: int) -> None:
    (tmp_path / "test_notes.py").write_text(NOTES)
    options = ["-p", "tests.report_tables", "-p", "no:cacheprovider", "-n", str(processes), "--rootdir", str(tmp_path)]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    # The other plug-ins of this environment take two seconds to import, in each process.
    environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    options += ["-p", "xdist.plugin"]
    answer = subprocess.run(
        [sys.executable, "-m", "pytest", *options, str(tmp_path)],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    table = [line for line in answer.stdout.splitlines() if line.startswith("|")]
    assert table == [
        "| fault | longest gap between frames | lasted |",
        "| --- | --- | --- |",
        "| a | 7 ms | 1 s |",
        "| b | 7 ms | 1 s |",
    ]
