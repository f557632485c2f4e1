"""The progress bar of commands that take a while."""

from __future__ import annotations

from collections.abc import Callable

from rich.console import Console
from rich.progress import Progress, TaskID


def progress_bar() -> Progress:
    """A bar on stderr that goes when the work is done; none, not even an empty line, where stderr is no terminal."""
    console = Console(stderr=True)
    return Progress(console=console, transient=True, disable=not console.is_terminal)


def stage_reporter(progress: Progress) -> Callable[[str, int, int | None], None]:
    """A function that is told stage, done and total, and shows each stage as a line of its own."""
    lines: dict[str, TaskID] = {}

    def tell(stage: str, done: int, total: int | None) -> None:
        if stage not in lines:
            lines[stage] = progress.add_task(stage, total=total)
        progress.update(lines[stage], completed=done, total=total)

    return tell
