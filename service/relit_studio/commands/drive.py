"""`drive`: a driving video."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer

from relit_camera.cli.arguments import parse_size
from relit_studio.commands.options import (
    Environment,
    Out,
    PersonName,
    Samples,
    Threads,
    Truth,
    Turn,
    load_person,
    load_room,
    quality_of,
    shown_progress,
)
from relit_studio.drive.drive_renderer import DriveSettings, render_drive
from relit_studio.drive.performances.performance_catalog import PERFORMANCES, find_performance

_PERFORMANCES = "; ".join(f"{name} ({each.summary})" for name, each in PERFORMANCES.items())


def drive(
    out: Out,
    who: PersonName = "adam",
    performance: Annotated[str, typer.Option(help=f"What they do: {_PERFORMANCES}.")] = "talk",
    environment: Environment = "soft",
    turn: Turn = 0.0,
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the video, pixels.")] = "960x540",
    every: Annotated[int, typer.Option(min=1, max=24, help="Render only every N-th frame.")] = 1,
    frames: Annotated[int | None, typer.Option(min=1, help="Of the performance, from its beginning; else all.")] = None,
    webcam: Annotated[
        bool, typer.Option("--webcam/--plain", help="As a webcam takes it: automatics, noise; or plainly exposed.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Of the noise.")] = 0,
    samples: Samples = None,
    truth: Truth = False,
    threads: Threads = 2,
) -> None:
    """Render a person who performs before a webcam, with the truth; run it again to go on after a stop."""
    chosen = find_performance(performance)
    width, height = parse_size(size)
    if min(width, height) < 32 or max(width, height) > 4096 or width % 2 or height % 2:
        raise typer.BadParameter(f"'{size}' has sides that are odd or not within 32 and 4096", param_hint="--size")
    if frames and frames > chosen.frames:
        raise typer.BadParameter(f"{performance} has {chosen.frames} frames, not {frames}", param_hint="--frames")
    quality = replace(quality_of(truth, samples, threads, 48), seed=seed)
    settings = DriveSettings((width, height), every, frames or chosen.frames, quality)
    room = load_room(environment, turn)
    with shown_progress("frames") as progress:
        seconds = render_drive(load_person(who), chosen, room, out, settings, webcam=webcam, progress=progress)
    if seconds:
        typer.echo(f"{len(seconds)} frames, {sum(seconds.values()) / len(seconds):.1f} s each")
    typer.echo(f"relit replay {out / 'clip.mp4'} --tracker recorded:{out / 'track.json'} --subject {who}.relit …")
