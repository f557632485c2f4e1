"""Tables at the end of a test run: rows noted by tests, in whichever process a test ran."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest

Row = tuple[str, ...]
TABLES = {
    "what a picture costs, in runs of a network like the face mesh": (
        "mode",
        "now",
        "recorded",
        "recorded at",
        "less well than asked",
    ),
    "faults survived": ("fault", "longest gap between frames", "lasted"),
    "steps in the browser": ("flow", "step", "took"),
    "what the panel costs": ("what", "measured", "at most"),
    "two hundred viewers": ("frames a second", "longest gap between frames", "pictures for each"),
    "readers of the virtual camera": ("reader", "v4l2loopback", "saw"),
    "a camera in PipeWire that is killed and started again": ("packages", "camera", "longest gap for GStreamer"),
    "a camera whose keeper goes on": ("what happens", "longest gap between pictures"),
    "relit run in PipeWire": ("packages", "reader", "mean difference from what is published, of 255"),
    "the keeper of a camera in PipeWire": ("packages", "memory"),
    "readers of the camera in PipeWire": ("packages", "reader", "largest difference of 255"),
}
"""Title and columns of every table."""


@pytest.fixture
def note_row(record_property: Callable[[str, object], None]) -> Callable[[str, Row], None]:
    """A function that adds a row to the table of a title.

    The row travels with the test's report, so that it arrives from the processes of pytest-xdist.
    """

    def note(title: str, row: Row) -> None:
        assert len(row) == len(TABLES[title])
        record_property(title, row)

    return note


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print every table that has rows, as Markdown."""
    reports = [report for group in terminalreporter.stats.values() for report in group]
    for title, columns in TABLES.items():
        rows = sorted(rows_of(title, reports))
        if rows:
            terminalreporter.section(title)
            for row in (columns, ("---",) * len(columns), *rows):
                terminalreporter.write_line(f"| {' | '.join(row)} |")


def rows_of(title: str, reports: Iterable[object]) -> list[Row]:
    """The rows of one table that the reports of finished tests carry."""
    calls = (report for report in reports if isinstance(report, pytest.TestReport) and report.when == "call")
    return [tuple(map(str, row)) for report in calls for name, row in report.user_properties if name == title]  # type: ignore[call-overload]
