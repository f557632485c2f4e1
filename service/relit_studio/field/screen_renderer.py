"""A person before a screen, one patch of it after another, by Cycles: what a desk capture has to tell apart."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.images.image_files import write_display
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.capture.desk.desk_recording import DeskSetup
from relit_camera.capture.desk.person.patch_light import place_patches
from relit_studio.base.assets.manifest import manifest
from relit_studio.base.progress import Progress, no_progress
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.exr import read_rgba
from relit_studio.cycles.job import PatchLight, Picture, Quality
from relit_studio.cycles.person_objects import Figure
from relit_studio.cycles.runner import render
from relit_studio.mannequin.outputs.olat import gray, light_names, lights_text
from relit_studio.people.face.landmarks import landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture

_MIDDLE = 0.6
"""Of the face's half height: within this distance from its middle, the mean depth is that of the face."""
_IRIS_POINTS = 10


@dataclass(frozen=True)
class ScreenSettings:
    """Settings of the pictures.

    Attributes:
        size: of the pictures, pixels.
        quality: of the pictures.
    """

    size: int = 256
    quality: Quality = field(default_factory=Quality)


def render_screen(
    person: Person, setup: DeskSetup, folder: Path, settings: ScreenSettings, progress: Progress = no_progress
) -> dict[str, float]:
    """Render the neutral person under each patch of a screen, except existing pictures; returns the seconds of each.

    The pictures are those of a field (`field_renderer`), but for the light: `00.exr` … are linear, over black, under
    one patch, which is as bright as a white wall that reads 1. Beside them `lights.lp` (the patches' directions
    from the middle of the face, in the order of `place_patches`), `matte.png` and `screen.json` (settings, credits).

    Args:
        person: who sits there, the middle of the face before that of the screen, as far off as the setup says.
        setup: the screen, its patches, and where the webcam is.
        folder: for the pictures.
        settings: of them.
        progress: told of pictures that are done, and their total.

    Raises:
        InputError: the folder holds pictures of other settings.
        DeviceError: Cycles is not set up, or fails.
        StorageError: the folder cannot be written.
    """
    description = {
        "person": asdict(person.traits),
        "setup": setup.model_dump(mode="json"),
        "settings": {"size": settings.size, "quality": settings.quality.settings()},
        "credits": list(manifest().credits.values()),
    }
    keep_settings(folder, "screen.json", description)
    patches = place_patches(setup)
    names = light_names(len(patches.centers_cm))
    pictures = [
        Picture(folder / name, PatchLight((x, y, z), patches.size_cm))
        for name, (x, y, z) in zip(names, (patches.centers_cm + face_middle_cm(person)).tolist(), strict=True)
    ]
    seconds = render(Figure(person).scene(), Camera(settings.size), settings.quality, pictures, progress)
    write_display(folder / "matte.png", gray(np.clip(read_rgba(pictures[0].path)[1], 0, 1)))
    # Last, since by it others know that the pictures are there.
    write_atomic(folder / "lights.lp", lights_text(names, patches.directions))
    return seconds


def face_middle_cm(person: Person) -> Float64Array:
    """The middle (3,) of the face in room axes, as a desk capture has it: of its height, its width, its mean depth."""
    points = landmarks(person, Posture())["mesh478"][:-_IRIS_POINTS]
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    off = np.hypot(*(points - middle)[:, :2].T)
    return np.array([*middle[:2], points[off < _MIDDLE * (high - low)[1] / 2, 2].mean()])
