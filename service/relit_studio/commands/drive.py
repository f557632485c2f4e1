"""`drive`: a driving video."""

from __future__ import annotations

from typing import Annotated

import typer

from relit_camera.cli.parse import size as parse_size
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
from relit_studio.drive.performance import FRAMES
from relit_studio.drive.render import DriveSettings, render_drive


def drive(
    out: Out,
    who: PersonName = "adam",
    environment: Environment = "soft",
    turn: Turn = 0.0,
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the video, pixels.")] = "960x540",
    every: Annotated[int, typer.Option(min=1, max=24, help="Make only every so manieth frame.")] = 1,
    frames: Annotated[int, typer.Option(min=1, max=FRAMES, help="Of the performance, from its beginning.")] = FRAMES,
    samples: Samples = None,
    truth: Truth = False,
    threads: Threads = 2,
) -> None:
    """Render a person who talks and turns in a room, with the truth; run it again to go on after a stop."""
    width, height = parse_size(size)
    if any(side % 2 or not 32 <= side <= 4096 for side in (width, height)):
        raise typer.BadParameter(f"'{size}' has sides that are odd or not within 32 and 4096", param_hint="--size")
    settings = DriveSettings((width, height), every, frames, quality_of(truth, samples, threads, 48))
    with shown_progress("frames") as progress:
        seconds = render_drive(load_person(who), load_room(environment, turn), out, settings, progress)
    if seconds:
        typer.echo(f"{len(seconds)} frames, {sum(seconds.values()) / len(seconds):.1f} s each")
    typer.echo(f"relit replay {out / 'clip.mp4'} --tracker recorded:{out / 'track.json'} --subject {who}.relit …")
