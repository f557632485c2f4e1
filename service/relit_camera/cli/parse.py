"""Reading values that the command line packs into one word."""

from __future__ import annotations

import math

import typer


def numbers(text: str, count: int, option: str) -> list[float]:
    """Comma-separated finite numbers.

    Raises:
        typer.BadParameter: another count, or something that is no number (exit 2: usage).
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise typer.BadParameter(f"'{text}' is not {count} numbers with commas between", param_hint=option)
    return values
