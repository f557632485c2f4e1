"""Progress callbacks of long work."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the number of finished pictures and their total."""


def no_progress(done: int, total: int) -> None:
    """Ignore the progress."""
