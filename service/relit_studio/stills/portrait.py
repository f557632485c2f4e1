"""Single pictures of people."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.images.image_files import write_display
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_studio.base.progress import Progress, no_progress
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.exr import read_rgba
from relit_studio.cycles.job import Picture, Quality
from relit_studio.cycles.person_objects import Figure
from relit_studio.cycles.runner import render
from relit_studio.drive.room import Room
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture

_EDGE_PX = 0.8


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
        return [room.shown(*_calmed(*read_rgba(picture.path)), backdrop) for picture in pictures]


def finish_stills(
    paths: Sequence[Path],
    person: Person,
    postures: Sequence[Posture],
    room: Room,
    camera: Camera,
    quality: Quality,
) -> None:
    """Render those of the files that are not there yet, one a posture.

    Raises:
        DeviceError: Cycles is not set up, or fails.
        StorageError: a file cannot be written.
    """
    missing = [(path, posture) for path, posture in zip(paths, postures, strict=True) if not path.is_file()]
    if not missing:
        return
    pictures = render_stills(person, [posture for _, posture in missing], room, camera, quality)
    for (path, _), picture in zip(missing, pictures, strict=True):
        write_display(path, picture)


def _calmed(picture: LinearImage, alpha: Mask) -> tuple[LinearImage, Mask]:
    """A premultiplied picture (h, w, 3) and its alpha (h, w) with soft edges: Cycles denoises colors, but no alpha."""
    edge = cv2.dilate(np.asarray((alpha > 0.02) & (alpha < 0.98), np.uint8), np.ones((3, 3), np.uint8)) > 0
    soft = np.where(edge, cv2.GaussianBlur(alpha, (0, 0), _EDGE_PX), alpha)
    return np.where(edge[..., None], cv2.GaussianBlur(picture, (0, 0), _EDGE_PX), picture), np.asarray(soft, np.float32)
