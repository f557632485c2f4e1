"""`bundle`: the demonstration's files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relit_camera.app.demo.demo_files import FOLDER
from relit_studio.commands.options import shown_progress
from relit_studio.demo_bundle import make_bundle


def bundle(
    field: Annotated[Path, typer.Option(help="Folder of `field`.", metavar="DIR")],
    clip: Annotated[Path, typer.Option(help="Folder of `drive`, of the same person.", metavar="DIR")],
    out: Annotated[Path, typer.Option(help="Folder to write to: the demo's own.", metavar="DIR")] = FOLDER,
    expressions: Annotated[
        Path | None, typer.Option(help="Folder of another `drive`, for expression stills.", metavar="DIR")
    ] = None,
    components: Annotated[int, typer.Option(min=1, help="Principal pictures that the subject keeps.")] = 48,
) -> None:
    """Make what `relit demo` is shipped with."""
    with shown_progress("pictures") as progress:
        made = make_bundle(field, clip, out, components, progress, expressions)
    for path in made:
        typer.echo(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
