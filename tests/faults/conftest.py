"""A table of the faults that were survived, at the end of the run: the one in docs/reliability.md."""

from __future__ import annotations

import time

import pytest

from tests.faults.watched_camera import LONGEST_GAP_S, Survived, Watched

ROWS: list[tuple[str, float, float]] = []


@pytest.fixture
def survived() -> Survived:
    """Called at a fault's end, with its name."""

    def note(name: str, watched: Watched) -> None:
        gap_s, took_s = watched.sink.longest_gap_s(watched.since), time.monotonic() - watched.since
        ROWS.append((name, gap_s, took_s))
        assert gap_s < LONGEST_GAP_S, f"{name}: {gap_s:.2f} s without a frame"

    return note


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not ROWS:
        return
    terminalreporter.section("faults survived")
    terminalreporter.write_line("| fault | longest gap between frames | lasted |")
    terminalreporter.write_line("|---|---|---|")
    for name, gap_s, took_s in ROWS:
        terminalreporter.write_line(f"| {name} | {1e3 * gap_s:.0f} ms | {took_s:.1f} s |")
