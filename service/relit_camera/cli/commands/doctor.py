"""`relit doctor`: finds what prevents the camera from working, and says what to do."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer()


@app.command()
def doctor(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
    fix: Annotated[
        bool, typer.Option("--fix", help="Write your own missing files, and print the lines for root.")
    ] = False,
) -> None:
    """Find out what keeps the camera from working, and the cure. Exits with 1 if there is a problem."""
    from relit_camera.doctor.report import report_lines
    from relit_camera.doctor.run_checks import run_checks

    report = run_checks((context.find_root().obj or {}).get("config"), with_fix=fix)
    typer.echo(report.model_dump_json(indent=2) if as_json else "\n".join(report_lines(report)))
    if not report.healthy:
        raise typer.Exit(1)
