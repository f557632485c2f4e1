"""`person`: one still."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relit_camera.base.images.image_files import encode_display
from relit_camera.base.rotations import Angles
from relit_camera.base.storage.atomic_files import atomic_path
from relit_studio.cameras.studio_camera import Camera
from relit_studio.commands.options import (
    Environment,
    PersonName,
    Samples,
    Size,
    Threads,
    Truth,
    Turn,
    load_person,
    load_room,
    quality_of,
    shown_progress,
)
from relit_studio.people.face.expressions import find_expression
from relit_studio.people.posture import Posture
from relit_studio.stills.portrait import render_stills


def person(
    out: Annotated[Path, typer.Option("--out", help="Picture, .png or .jpg.", metavar="FILE")],
    who: PersonName = "adam",
    expression: Annotated[str, typer.Option(help="neutral, smile, talk or blink.")] = "neutral",
    yaw: Annotated[float, typer.Option(help="Degrees; > 0 turns the nose to the picture's right.")] = 0.0,
    pitch: Annotated[float, typer.Option(help="Degrees; > 0 turns the nose down.")] = 0.0,
    roll: Annotated[float, typer.Option(help="Degrees; > 0 lifts the picture's right side.")] = 0.0,
    environment: Environment = "window",
    turn: Turn = 0.0,
    size: Size = 512,
    view_cm: Annotated[float, typer.Option(min=2, max=100, help="What a side spans at the head.")] = Camera.view_cm,
    middle_cm: Annotated[float, typer.Option(help="Height of the view's middle over the ears.")] = Camera.middle_cm,
    samples: Samples = None,
    truth: Truth = False,
    threads: Threads = 2,
) -> None:
    """Render one picture of a person."""
    if out.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise typer.BadParameter(f"{out} is neither .png nor .jpg", param_hint="--out")
    posture = Posture(Angles(yaw, pitch, roll), find_expression(expression))
    camera = Camera(size, view_cm=view_cm, middle_cm=middle_cm)
    room, quality = load_room(environment, turn), quality_of(truth, samples, threads, 48)
    # Opened before the work, so that an output that cannot be written fails at once.
    with atomic_path(out) as file, shown_progress(who) as progress:
        (picture,) = render_stills(load_person(who), [posture], room, camera, quality, progress)
        file.write_bytes(encode_display(picture, file.suffix))
