"""`check`: whether public face models detect the studio's people."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from relit_camera.base.images.image_files import read_display
from relit_camera.base.rotations import Angles
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.cli.arguments import parse_numbers
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.studio_camera import Camera
from relit_studio.commands.options import (
    Environment,
    Out,
    Samples,
    Size,
    Threads,
    load_person,
    load_room,
    quality_of,
    shown_progress,
)
from relit_studio.people.posture import Posture
from relit_studio.stills.detectability import check_detectability, detectability_table
from relit_studio.stills.portrait import finish_stills

_TRACKERS = ("mesh", "openseeface")


def check(
    out: Out,
    people: Annotated[str, typer.Option(help="Names and numbers, with commas between.")] = "adam,bea,cem,1,2,3,4,5",
    yaws: Annotated[str, typer.Option(help="Degrees, with commas between.")] = "-45,-30,-15,0,15,30,45",
    pitches: Annotated[str, typer.Option(help="Degrees, with commas between.")] = "0",
    environment: Environment = "soft",
    size: Size = 256,
    samples: Samples = None,
    threads: Threads = 2,
) -> None:
    """Render people in several poses, run the public face models on them, and write fractions and errors to check.json.

    Finished pictures are kept. The models are those of `relit models pull`.
    """
    detector = open_face_detector()
    trackers = [open_tracker(name, TrackerOptions(blendshapes=False)) for name in _TRACKERS]
    turns = [
        Angles(yaw, pitch, 0.0)
        for pitch in parse_numbers(pitches, pitches.count(",") + 1, "--pitches")
        for yaw in parse_numbers(yaws, yaws.count(",") + 1, "--yaws")
    ]
    camera, room, quality = Camera(size), load_room(environment, 0.0), quality_of(False, samples, threads)
    keep_settings(out, "settings.json", {"environment": environment, "size": size, "samples": quality.samples})
    seen, names = [], people.split(",")
    with shown_progress("people") as progress:
        for done, who in enumerate(names):
            person, postures = load_person(who), [Posture(angles) for angles in turns]
            paths = [out / f"{who}-{angles.yaw:g}-{angles.pitch:g}.png" for angles in turns]
            finish_stills(paths, person, postures, room, camera, quality)
            for path, posture in zip(paths, postures, strict=True):
                seen.append(check_detectability(read_display(path), person, posture, camera, detector, trackers))
            progress(done + 1, len(names))
    rows = detectability_table(seen)
    write_atomic(out / "check.json", json.dumps(rows, indent=1) + "\n")
    table = Table(*rows[0])
    for row in rows:
        table.add_row(*map(_cell, row.values()))
    Console(width=max(100, Console().width)).print(table)


def _cell(value: float | str | int | None) -> str:
    if value is None:
        return "–"
    return f"{100 * value:.1f} %" if isinstance(value, float) else str(value)
