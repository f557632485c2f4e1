"""`relit subject`: look into subject files."""

from __future__ import annotations

import json
from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True)


@app.callback()
def group() -> None:
    """Look into subject files."""


@app.command()
def info(
    context: typer.Context,
    subject: Annotated[str, typer.Argument(help="A stored subject's name, or a .relit file.")],
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable.")] = False,
) -> None:
    """Show what a subject file holds."""
    from relit_camera.cli.settings import settings_of
    from relit_camera.subject.store import SubjectStore

    name, opened = SubjectStore(settings_of(context).storage.subjects).resolve(subject)
    shown = {"name": name, **opened.metadata.model_dump(mode="json")}
    shown["landmarks"] = {scheme: len(points) for scheme, points in opened.landmarks.items()}
    shown["bytes"] = sum(a.nbytes for a in (opened.basis, opened.coefficients, opened.light_coefficients))
    if as_json:
        typer.echo(json.dumps(shown, indent=2))
        return
    for key, value in shown.items():
        typer.echo(f"{key:16} {value}")
