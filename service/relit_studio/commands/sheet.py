"""`sheet`: a contact sheet of people."""

from __future__ import annotations

from typing import Annotated

import typer

from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_files import read_display, write_display
from relit_camera.base.rotations import Angles
from relit_camera.cli.arguments import parse_numbers
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.studio_camera import Camera
from relit_studio.commands.options import (
    Environment,
    Out,
    Samples,
    Size,
    Threads,
    Turn,
    load_person,
    load_room,
    quality_of,
    shown_progress,
)
from relit_studio.people.face.expressions import find_expression
from relit_studio.people.posture import Posture
from relit_studio.stills.portrait import finish_stills


def sheet(
    out: Out,
    people: Annotated[str, typer.Option(help="Names and numbers, with commas between.")] = "adam,bea,cem",
    expressions: Annotated[str, typer.Option(help="One cell a person and expression.")] = "neutral",
    yaws: Annotated[str, typer.Option(help="Degrees, with commas between; one cell each.")] = "0",
    columns: Annotated[int, typer.Option(min=1, max=24)] = 6,
    environment: Environment = "window",
    turn: Turn = 0.0,
    size: Size = 256,
    samples: Samples = None,
    threads: Threads = 2,
) -> None:
    """Render people into DIR, one picture each, and lay them out in DIR/sheet.png; finished pictures are left."""
    camera, room = Camera(size), load_room(environment, turn)
    quality = quality_of(False, samples, threads)
    looks = [
        (name, yaw) for name in expressions.split(",") for yaw in parse_numbers(yaws, yaws.count(",") + 1, "--yaws")
    ]
    postures = [Posture(Angles(yaw, 0.0, 0.0), find_expression(name)) for name, yaw in looks]
    keep_settings(
        out, "sheet.json", {"environment": environment, "turn": turn, "size": size, "samples": quality.samples}
    )
    cells = []
    with shown_progress("people") as progress:
        names = people.split(",")
        for done, who in enumerate(names):
            paths = [out / f"{who}-{name}-{yaw:g}.png" for name, yaw in looks]
            if not all(path.is_file() for path in paths):
                finish_stills(paths, load_person(who), postures, room, camera, quality)
            cells += [read_display(path) for path in paths]
            progress(done + 1, len(names))
    rows = [cells[start : start + columns] for start in range(0, len(cells), columns)]
    write_display(out / "sheet.png", contact_sheet(rows, cell_width=size))
