"""Single pictures of people."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from relit_camera.space.images import DisplayImage
from relit_studio.camera import Camera
from relit_studio.cycles.exr import read_rgba
from relit_studio.cycles.figure import Figure
from relit_studio.cycles.job import Picture, Quality
from relit_studio.cycles.runner import render
from relit_studio.drive.room import Room
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture
from relit_studio.progress import Progress, no_progress


def render_stills(
    person: Person,
    postures: Sequence[Posture],
    room: Room,
    camera: Camera,
    quality: Quality,
    progress: Progress = no_progress,
) -> list[DisplayImage]:
    """The person in each posture before the room, as a webcam shows it, uint8 sRGB.

    Raises:
        DeviceError: Cycles is not set up, or fails.
    """
    figure = Figure(person)
    with tempfile.TemporaryDirectory(prefix="relit-studio.") as name:
        folder = Path(name)
        light = room.light(folder)
        pictures = [
            Picture(folder / f"{index:04d}.exr", light, figure.shape(posture)) for index, posture in enumerate(postures)
        ]
        render(figure.scene(), camera, quality, pictures, progress)
        backdrop = room.backdrop(camera)
        return [room.shown(*read_rgba(picture.path), backdrop) for picture in pictures]
