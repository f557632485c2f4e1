"""`python -m relit_studio capture`: a phone capture video whose truth is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relit_studio.commands.options import ROOM_HELP, load_room, shown_progress


def capture(
    out: Annotated[Path, typer.Option(help="Folder for capture.mp4, truth.json and sheet.png; made if missing.")],
    person: Annotated[str, typer.Option(help="'mannequin', or a field's folder (lights.lp with its truth).")] = (
        "mannequin"
    ),
    room: Annotated[str, typer.Option(help=ROOM_HELP)] = "window",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT; a field keeps its shape and takes the height.")] = "540x720",
    seconds: Annotated[float, typer.Option(min=0.2, max=600, help="Length of the video.")] = 30.0,
    seed: Annotated[int, typer.Option(min=0, help="Of hand, head, flash phase and noise.")] = 1,
    flash_hz: Annotated[float, typer.Option(min=0.5, max=15, help="Flashes a second.")] = 5.0,
    ambient: Annotated[
        float, typer.Option(min=0, max=1, help="A white ball's reading in the room's light; the torch gives 1.")
    ] = 0.08,
    motion: Annotated[float, typer.Option(min=0, max=10, help="Scales the head's movements; 0 holds it still.")] = 1.0,
    gamma: Annotated[bool, typer.Option(help="The sRGB curve; without, linear codes.")] = True,
    noise: Annotated[bool, typer.Option(help="Sensor noise.")] = True,
    h264: Annotated[bool, typer.Option(help="H.264; without, lossless FFV1 (capture.mkv).")] = True,
    auto_exposure: Annotated[bool, typer.Option(help="Exposure that hunts.")] = True,
    white_balance: Annotated[bool, typer.Option(help="White balance that hunts.")] = True,
    second_ball: Annotated[bool, typer.Option("--second-ball", help="A ball on either side of the head.")] = False,
    plain: Annotated[bool, typer.Option("--plain", help="No processing at all: linear, exact, lossless.")] = False,
) -> None:
    """Film a person under a blinking hand-held torch, a mirror ball beside them. Run it again to go on."""
    from relit_camera.cli.arguments import parse_size
    from relit_studio.capture.capture_scene import Scene, Timing, dimmed
    from relit_studio.capture.persons.captured_person import Person
    from relit_studio.capture.persons.field_person import FieldPerson
    from relit_studio.capture.persons.mannequin_person import MannequinPerson, phone_camera
    from relit_studio.capture.phone import Stages
    from relit_studio.capture.recording import record

    width, height = parse_size(size)
    if not (64 <= width <= 4096 and 64 <= height <= 4096):
        raise typer.BadParameter(f"'{size}' has sides that are not within 64 and 4096", param_hint="--size")
    environment = load_room(room, 0.0).environment
    light, light_map = dimmed(environment, ambient)
    on = not plain
    stages = Stages(on and gamma, on and noise, on and auto_exposure, on and white_balance, on and h264)
    captured_person: Person = (
        MannequinPerson(phone_camera(width, height), light_map)
        if person == "mannequin"
        else FieldPerson(Path(person), height, light_map)
    )
    timing = Timing(seconds=seconds, flash_hz=flash_hz)
    scene = Scene(captured_person, light, timing, seed, motion, balls=2 if second_ball else 1)
    with shown_progress("Frames") as progress:
        video, truth = record(scene, stages, out, environment.name, seed, progress)
    typer.echo(f"{video}: {scene.timing.frames} frames of {scene.camera.width}x{scene.camera.height}; truth in {truth}")
