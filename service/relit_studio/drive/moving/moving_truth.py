"""What is rendered of a person to measure the moving picture: reflectance field, webcam clips in rooms, the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from relit_camera.base.storage.atomic_files import make_folder
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.capture.subject_landmarks import read_landmarks
from relit_camera.subject.subject_file import write_subject
from relit_studio.base.progress import Progress
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.job import Quality
from relit_studio.drive.clip_files import write_clip
from relit_studio.drive.drive_renderer import DriveSettings, render_drive
from relit_studio.drive.performance import frame_times
from relit_studio.drive.performances.meeting import MEETING
from relit_studio.drive.room import Room
from relit_studio.drive.take import Take
from relit_studio.field.field_renderer import FieldSettings, render_field
from relit_studio.people.person import Person

TRUTH_SEED = 7
"""Of the noise of the truth, another than the clips'."""
LAMP_ROOMS, SWITCHED = ("soft", "lamp"), "switched"
"""The room before and after somebody switches a lamp on, and the name of the clip in which they do so, halfway."""


@dataclass(frozen=True)
class MovingSettings:
    """Settings of what is rendered.

    Attributes:
        size: width and height of the clips, pixels.
        every: render only every N-th frame of the performance.
        frames: of the performance, from its beginning.
        samples: a pixel.
        field_lights: lights of the field.
        field_size: of its pictures, pixels.
    """

    size: tuple[int, int] = (480, 270)
    every: int = 6
    frames: int = MEETING.frames
    samples: int = 10
    field_lights: int = 96
    field_size: int = 256


@dataclass(frozen=True)
class MovingTruth:
    """Files of one person.

    Attributes:
        folder: of all of them.
    """

    folder: Path

    @property
    def subject(self) -> Path:
        """The subject file, made of the field's pictures."""
        return self.folder / "subject.relit"

    def clip(self, room: str) -> Path:
        """Folder of the performance as a webcam takes it in a room."""
        return self.folder / f"room-{room}"

    def truth(self, light: str) -> Path:
        """Folder of the same performance under the light that is wanted."""
        return self.folder / f"light-{light}"


def render_field_subject(person: Person, files: MovingTruth, settings: MovingSettings, progress: Progress) -> None:
    """Render a person's reflectance field and make a subject of it, unless that is done.

    Raises:
        InputError: the folder was begun with other settings.
        DeviceError: Cycles is not set up, or fails.
        StorageError: a file cannot be written.
    """
    if files.subject.is_file():
        return
    field = files.folder / "field"
    quality = Quality(settings.samples)
    render_field(person, field, FieldSettings(settings.field_lights, settings.field_size, quality=quality), progress)
    lights = field / "lights.lp"
    points = read_landmarks(field / "landmarks.json", required=True)
    write_subject(files.subject, build_subject(import_samples(lights), "default", lights.name, "srgb", points))


def render_clip(
    person: Person, folder: Path, room: Room, settings: MovingSettings, progress: Progress, *, webcam: bool
) -> None:
    """Render the performance `meeting` in a room, as a webcam takes it or as the truth, unless that is done.

    Raises:
        InputError: the folder was begun with other settings.
        DeviceError: Cycles is not set up, or fails.
        StorageError: a file cannot be written.
    """
    if (folder / "truth.json").is_file():
        return
    quality = Quality(settings.samples, seed=0 if webcam else TRUTH_SEED)
    drive = DriveSettings(settings.size, settings.every, settings.frames, quality)
    render_drive(person, MEETING, room, folder, drive, webcam=webcam, progress=progress)


def switch_lamp_on(person: Person, files: MovingTruth, room: Room, settings: MovingSettings) -> Path:
    """Make the clip in which a lamp is switched on halfway, of the rendered clips of both rooms; returns its folder.

    Raises:
        ImageError: a frame is damaged.
        StorageError: a file cannot be written.
    """
    folder = files.clip(SWITCHED)
    if (folder / "truth.json").is_file():
        return folder
    times = frame_times(settings.frames)[:: settings.every].tolist()
    before, after = (files.clip(name) / "frames" for name in LAMP_ROOMS)
    names = [f"{index * settings.every:04d}.exr" for index in range(len(times))]
    half = len(names) // 2
    frames = [before / name for name in names[:half]] + [after / name for name in names[half:]]
    make_folder(folder)
    width, height = settings.size
    take = Take(person, MEETING, Camera(height, width))
    write_clip(take, room, folder, list(zip(frames, times, strict=True)), 0)
    return folder
