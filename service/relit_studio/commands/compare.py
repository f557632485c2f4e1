"""`compare`: two renderings of one field."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relit_studio.field.field_comparison import compare_fields


def compare(
    first: Annotated[Path, typer.Argument(help="A field's folder: the reference.", metavar="DIR")],
    second: Annotated[Path, typer.Argument(help="Another of the same scene.", metavar="DIR")],
) -> None:
    """Compare two renderings of one field."""
    found = compare_fields(first, second)
    typer.echo(f"single lights {found.median_db:.1f} dB (worst {found.worst_db:.1f})")
    typer.echo(f"light in all {found.energy_ratio:.3f} of the first's")
