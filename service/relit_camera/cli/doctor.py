"""`relit doctor`: what keeps the camera from working, and the cure."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer()


@app.command()
def doctor(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Find out what keeps the camera from working, and the cure. Exits with 1 if there is a problem."""
    from relit_camera.doctor.examine import examine, table

    report = examine((context.find_root().obj or {}).get("config"))
    typer.echo(report.model_dump_json(indent=2) if as_json else "\n".join(table(report)))
    if not report.healthy:
        raise typer.Exit(1)
