"""`moving`: how near the moving relit person comes to the truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from relit_camera.base.config.look import Mode
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_files import write_display
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.lab.evaluate.video.moving_face_accuracy import PARTS, PartFigures, figures_table
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject
from relit_studio.commands.options import Out, load_person, load_room, shown_progress
from relit_studio.drive.moving.moving_table import (
    FILMED,
    INSTANT,
    capture_from_clip,
    error_sheet,
    evaluate_filmed,
    evaluate_mode,
    read_truth,
)
from relit_studio.drive.moving.moving_truth import (
    LAMP_ROOMS,
    SWITCHED,
    MovingSettings,
    MovingTruth,
    render_clip,
    render_field_subject,
    switch_lamp_on,
)


def moving(
    out: Out,
    people: Annotated[str, typer.Option(help="Names and numbers, with commas between.")] = "bea,17,cem,23",
    rooms: Annotated[
        str, typer.Option(help=f"Where they are filmed; '{SWITCHED}' is '{LAMP_ROOMS[0]}' with a lamp switched on.")
    ] = f"soft,side-window,ceiling,screen,party,{SWITCHED}",
    lights: Annotated[str, typer.Option(help="What they are taken into: environments.")] = "sunset,studio",
    modes: Annotated[str, typer.Option(help="Of the camera.")] = "live,portrait",
    tracker: Annotated[str, typer.Option(help="Name of the tracker.")] = "mesh",
    samples: Annotated[int, typer.Option(min=1, max=65536, help="A pixel.")] = 10,
    every: Annotated[int, typer.Option(min=1, max=24, help="Render only every N-th frame.")] = 6,
    field_size: Annotated[int, typer.Option(min=32, max=4096, help="Of the subject, pixels.")] = 256,
    field_lights: Annotated[int, typer.Option(min=4, max=9999, help="That the subject is made of.")] = 96,
    instant: Annotated[
        bool,
        typer.Option("--instant/--no-instant", help="Also live with an instant subject of each clip."),
    ] = True,
) -> None:
    """Render people who talk and turn before webcams and in the light that is wanted, and compare; it can be resumed.

    DIR/moving.json and a table on stdout have the PSNR of each part of the person, DIR/PERSON/*.png the pictures.
    """
    settings = MovingSettings(samples=samples, every=every, field_size=field_size, field_lights=field_lights)
    figures: list[tuple[str, PartFigures]] = []
    for name in people.split(","):
        files = MovingTruth(out / name)
        _render(name, files, rooms.split(","), lights.split(","), settings)
        subject = read_subject(files.subject)
        captured = {room: _captured(files.clip(room), name) for room in rooms.split(",")} if instant else {}
        for light in lights.split(","):
            truth, environment = read_truth(files.truth(light)), load_room(light, 0.0).environment
            for room in rooms.split(","):
                title = f"{name} {room} to {light}"
                rows = {FILMED: evaluate_filmed(files.clip(room), truth)}
                for mode in map(Mode, modes.split(",")):
                    rows[mode] = evaluate_mode(files.clip(room), truth, subject, environment, mode, tracker)
                if own := captured.get(room):
                    rows[INSTANT] = evaluate_mode(files.clip(room), truth, own, environment, Mode.LIVE, tracker)
                figures += [(f"{title}, {row}", found) for row, (found, _) in rows.items()]
                sheet = error_sheet(truth, {row: shown for row, (_, shown) in rows.items()})
                write_display(files.folder / f"{room}-{light}.png", sheet)
    typer.echo(figures_table(figures))
    parts = {title: {part: found.mean(part) for part in PARTS if part in found.decibels} for title, found in figures}
    write_atomic(out / "moving.json", json.dumps(parts, indent=1))


def _captured(clip: Path, name: str) -> Subject | None:
    """An instant subject of a clip; None, with a line on stderr, where it can be none, as for its user."""
    try:
        return capture_from_clip(clip)
    except CaptureError as error:
        typer.echo(f"{name}, {clip.name}: no instant subject: {error}", err=True)
        return None


def _render(name: str, files: MovingTruth, rooms: list[str], lights: list[str], settings: MovingSettings) -> None:
    person = load_person(name)
    with shown_progress(f"{name}: lights") as progress:
        render_field_subject(person, files, settings, progress)
    rendered = [room for room in rooms if room != SWITCHED] + (list(LAMP_ROOMS) if SWITCHED in rooms else [])
    for room in rendered:
        with shown_progress(f"{name}: {room}") as progress:
            render_clip(person, files.clip(room), load_room(room, 0.0), settings, progress, webcam=True)
    for light in lights:
        with shown_progress(f"{name}: {light}") as progress:
            render_clip(person, files.truth(light), load_room(light, 0.0), settings, progress, webcam=False)
    if SWITCHED in rooms:
        switch_lamp_on(person, files, load_room(LAMP_ROOMS[0], 0.0), settings)
