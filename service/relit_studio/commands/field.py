"""`field`: one-light pictures over the whole sphere."""

from __future__ import annotations

from typing import Annotated

import typer

from relit_studio.commands.options import (
    Out,
    PersonName,
    Samples,
    Size,
    Threads,
    Truth,
    load_person,
    quality_of,
    shown_progress,
)
from relit_studio.field.render import FieldSettings, render_field


def field(
    out: Out,
    who: PersonName = "adam",
    lights: Annotated[int, typer.Option(min=4, max=9999, help="Spread evenly over the whole sphere.")] = 253,
    size: Size = 256,
    light_size_deg: Annotated[float, typer.Option(min=0.1, max=90, help="Full angle of the lamp.")] = 2.0,
    samples: Samples = None,
    truth: Truth = False,
    threads: Threads = 2,
) -> None:
    """Render a person under one light after another, with the truth; run it again to go on after a stop."""
    settings = FieldSettings(lights, size, light_size_deg, quality_of(truth, samples, threads))
    with shown_progress("lights") as progress:
        seconds = render_field(load_person(who), out, settings, progress)
    _tell(seconds, f"relit capture import {out / 'lights.lp'} --out {who}.relit")


def _tell(seconds: dict[str, float], following: str) -> None:
    if seconds:
        typer.echo(f"{len(seconds)} pictures, {sum(seconds.values()) / len(seconds):.1f} s each")
    typer.echo(following)
