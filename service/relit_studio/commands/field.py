"""`field`: one-light pictures over the whole sphere."""

from __future__ import annotations

from enum import StrEnum
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
from relit_studio.field.cycles_comparison import render_solver_scene
from relit_studio.field.field_renderer import FieldSettings, render_field
from relit_studio.field.transport_solver import SolverSettings, write_solver_field


class Renderer(StrEnum):
    """Renderer of a field."""

    CYCLES = "cycles"
    SOLVER = "solver"


def field(
    context: typer.Context,
    out: Out,
    renderer: Annotated[
        Renderer,
        typer.Option(
            help="cycles: a person, as the other options say. solver: our own, without Cycles and without other "
            "options: the mannequin, 64x48 pixels under 16x8 lights, which Cycles renders as --person mannequin."
        ),
    ] = Renderer.CYCLES,
    who: PersonName = "adam",
    lights: Annotated[int, typer.Option(min=4, max=9999, help="Spread evenly over the whole sphere.")] = 253,
    size: Size = 256,
    light_size_deg: Annotated[float, typer.Option(min=0.1, max=90, help="Full angle of the lamp.")] = 2.0,
    samples: Samples = None,
    truth: Truth = False,
    threads: Threads = 2,
) -> None:
    """Render a person under one light after another, with the truth; with Cycles run it again to go on after a stop."""
    if renderer is Renderer.SOLVER:
        _refuse_other_options(context, "--renderer solver", "renderer")
        with shown_progress("lights") as progress:
            write_solver_field(out, progress=progress)
        who = "mannequin"
    elif who == "mannequin":
        _refuse_other_options(context, "--person mannequin", "renderer", "who", "samples", "threads")
        with shown_progress("lights") as progress:
            render_solver_scene(out, SolverSettings(), quality_of(True, samples, threads), progress)
    else:
        settings = FieldSettings(lights, size, light_size_deg, quality_of(truth, samples, threads))
        with shown_progress("lights") as progress:
            seconds = render_field(load_person(who), out, settings, progress)
        if seconds:
            typer.echo(f"{len(seconds)} pictures, {sum(seconds.values()) / len(seconds):.1f} s each")
    typer.echo(f"relit capture import {out / 'lights.lp'} --out {who}.relit")


def _refuse_other_options(context: typer.Context, choice: str, *taken: str) -> None:
    """Refuse options that do not apply to `choice`, which takes only the parameters `taken`.

    Raises:
        typer.BadParameter: another option was given.
    """
    given = [
        parameter.opts[0]
        for parameter in context.command.params
        if parameter.name not in ("out", *taken, None)
        and (source := context.get_parameter_source(parameter.name)) is not None
        and source.name == "COMMANDLINE"
    ]
    if given:
        raise typer.BadParameter(f"{choice} takes no {', '.join(given)}")
