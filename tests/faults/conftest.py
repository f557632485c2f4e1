"""Notes the faults that were survived for a table at the end of the run: the one in docs/reliability.md."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from tests.faults.watched_camera import LONGEST_GAP_S, Survived, Watched


@pytest.fixture
def survived(note_row: Callable[[str, tuple[str, ...]], None]) -> Survived:
    """Called at a fault's end, with its name."""

    def note(name: str, watched: Watched) -> None:
        gap_s, took_s = watched.longest_gap_s(), time.monotonic() - watched.since
        note_row("faults survived", (name, f"{1e3 * gap_s:.0f} ms", f"{took_s:.1f} s"))
        assert gap_s < LONGEST_GAP_S, f"{name}: {gap_s:.2f} s without a frame"

    return note
