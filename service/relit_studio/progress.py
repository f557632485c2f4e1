"""How work that takes a while tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Told how many pictures are done, and of how many."""


def no_progress(done: int, total: int) -> None:
    """Tell nobody."""
