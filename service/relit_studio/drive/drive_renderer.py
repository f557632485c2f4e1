"""Driving videos by Cycles: a person who performs in a room, frame by frame, with the truth."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

from relit_camera.base.storage.atomic_files import make_folder
from relit_studio.base.progress import Progress, no_progress
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.job import Picture, Quality
from relit_studio.cycles.runner import render
from relit_studio.drive.clip_files import write_clip
from relit_studio.drive.performance import Performance, frame_times
from relit_studio.drive.performances.talk import TALK
from relit_studio.drive.room import Room
from relit_studio.drive.take import Take
from relit_studio.people.person import Person

_CHUNK = 12
"""Frames rendered in one run of the worker."""


@dataclass(frozen=True)
class DriveSettings:
    """Settings of a driving video.

    Attributes:
        size: width and height of the frames, pixels.
        every: render only every N-th frame of the performance, at 1/N of its frame rate.
        frames: of the performance, from its beginning.
        quality: one noise seed for all frames, so that nothing flickers.
    """

    size: tuple[int, int] = (960, 540)
    every: int = 1
    frames: int = TALK.frames
    quality: Quality = field(default_factory=lambda: Quality(samples=48))


def render_drive(
    person: Person,
    performance: Performance,
    room: Room,
    folder: Path,
    settings: DriveSettings,
    *,
    webcam: bool = False,
    progress: Progress = no_progress,
) -> dict[str, float]:
    """Render the performance into `folder`, except frames that exist already; returns the seconds of each frame.

    `frames/0000.exr` … are linear RGBA, premultiplied over black, in the unit of one-light pictures. From them come
    `clip.mp4` (before the room; exposed for a white ball at 0.8, or as a webcam takes it), `matte.mp4`, `track.json`
    (for the tracker `recorded`) and `truth.json`.

    Raises:
        InputError: the folder was begun with other settings.
        DeviceError: Cycles is not set up, or fails.
        StorageError: the folder cannot be written.
    """
    width, height = settings.size
    take = Take(person, performance, Camera(height, width))
    keep_settings(folder, "drive.json", _description(take, room, settings))
    make_folder(folder / "frames")
    times = frame_times(settings.frames)[:: settings.every].tolist()
    paths = [folder / "frames" / f"{index * settings.every:04d}.exr" for index in range(len(times))]
    light = room.light(folder)
    seconds: dict[str, float] = {}
    missing = [index for index, path in enumerate(paths) if not path.is_file()]
    progress(len(times) - len(missing), len(times))
    for start in range(0, len(missing), _CHUNK):
        chunk = missing[start : start + _CHUNK]
        done = len(times) - len(missing) + start
        pictures = [Picture(paths[index], light, take.shape(times[index])) for index in chunk]

        def told(made: int, _: int, done: int = done) -> None:
            progress(done + made, len(times))

        seconds |= render(take.scene, take.camera, settings.quality, pictures, told)
    seed = settings.quality.seed if webcam else None
    write_clip(take, room, folder, list(zip(paths, times, strict=True)), seed)
    return seconds


def _description(take: Take, room: Room, settings: DriveSettings) -> dict[str, object]:
    """Settings that the frames depend on."""
    return {
        "person": asdict(take.person.traits),
        "performance": take.performance.name,
        "environment": room.environment.name,
        "environment_yaw_deg": room.yaw_deg,
        "settings": {**asdict(settings), "quality": settings.quality.settings()},
        "camera": {**asdict(take.camera), "focal_px": take.camera.focal_px},
    }
