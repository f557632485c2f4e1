"""The progress bar of long commands."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rich.console import Console
from rich.progress import Progress, TaskID


def progress_bar() -> Progress:
    """A progress bar on stderr that disappears at the end; nothing at all is printed where stderr is no terminal."""
    console = Console(stderr=True)
    return Progress(console=console, transient=True, disable=not console.is_terminal)


def line_printer(progress: Progress) -> Callable[[str], None]:
    """A function that prints a line above the bar, or on stdout where there is none."""
    if not progress.console.is_terminal:
        return print
    return partial(progress.console.print, markup=False, highlight=False, soft_wrap=True)


def stage_reporter(progress: Progress) -> Callable[[str, int, int | None], None]:
    """A function that takes stage, done and total, and shows each stage as a bar of its own."""
    lines: dict[str, TaskID] = {}

    def report(stage: str, done: int, total: int | None) -> None:
        if stage not in lines:
            lines[stage] = progress.add_task(stage, total=total)
        progress.update(lines[stage], completed=done, total=total)

    return report
