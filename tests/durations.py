"""How long each test took: `build/durations.json`, to which every part of the gate adds its own.

`python -m tests.durations` prints it, summed by folder.
"""

from __future__ import annotations

import json
import os
from collections import Counter, defaultdict
from collections.abc import Mapping
from pathlib import Path

import pytest
from filelock import FileLock

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "build" / "durations.json"
PART_VARIABLE = "TEST_PART"
"""Names the part of the tests that a pytest process runs. Where it is not set nothing is stored."""


class _Stopwatch:
    """Adds up what pytest reports of each test: set-up, the test, tear-down."""

    def __init__(self, part: str) -> None:
        self._part = part
        self._seconds: defaultdict[str, float] = defaultdict(float)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        name, _, group = report.nodeid.rpartition("@")  # pytest-xdist adds the group, where there is one
        self._seconds[name if name and "]" not in group else report.nodeid] += report.duration

    def pytest_sessionfinish(self) -> None:
        add_durations(self._part, self._seconds)


def pytest_configure(config: pytest.Config) -> None:
    """Register the stopwatch in the process that hears of all tests, which is not one of pytest-xdist's."""
    part = os.environ.get(PART_VARIABLE)
    if part and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Stopwatch(part), "durations")


def add_durations(part: str, seconds: Mapping[str, float], path: Path | None = None) -> None:
    """Store the seconds of each test of a part beside those of other parts, in `FILE` if no path is given."""
    path = path or FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    rounded = {name: round(took, 3) for name, took in sorted(seconds.items())}
    with FileLock(path.with_suffix(".lock")):  # parts run beside each other
        path.write_text(json.dumps(read_durations(path) | {part: rounded}, indent=0) + "\n")


def read_durations(path: Path | None = None) -> dict[str, dict[str, float]]:
    """Seconds of each test, by the part that ran it; empty where nothing is stored."""
    path = path or FILE
    found: dict[str, dict[str, float]] = json.loads(path.read_text()) if path.exists() else {}
    return found


def by_folder(durations: Mapping[str, Mapping[str, float]]) -> list[tuple[str, int, float]]:
    """Of each folder of `tests`, the longest first: its name, how many tests ran, and their seconds together."""
    count: Counter[str] = Counter()
    seconds: defaultdict[str, float] = defaultdict(float)
    for tests in durations.values():
        for name, took in tests.items():
            places = name.partition("::")[0].split("/")
            folder = "/".join(places[:2]) if len(places) > 2 else "tests"
            count[folder] += 1
            seconds[folder] += took
    longest_first = sorted(seconds, key=lambda folder: -seconds[folder])
    return [(folder, count[folder], seconds[folder]) for folder in longest_first]


def main() -> None:
    """Print, for each folder and for each part, how many tests ran and how long they took together."""
    durations = read_durations()
    print("| folder or part | tests | seconds |\n| --- | --- | --- |")
    parts = [(f"part {part}", len(tests), sum(tests.values())) for part, tests in durations.items()]
    for name, count, seconds in (*by_folder(durations), *parts):
        print(f"| {name} | {count} | {seconds:.0f} |")


if __name__ == "__main__":
    main()
