"""Driving videos by Cycles: a person who performs in a room, frame by frame, with the truth."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

from relit_camera.face.track_file import TrackRecorder
from relit_camera.files import make_folder, write_atomic
from relit_camera.space.images import Frame
from relit_camera.stream.video_writer import VideoWriter
from relit_studio.assets.manifest import manifest
from relit_studio.begun import keep_settings
from relit_studio.camera import Camera
from relit_studio.cycles.exr import read_rgba
from relit_studio.cycles.figure import Figure
from relit_studio.cycles.job import Picture, Quality
from relit_studio.cycles.runner import render
from relit_studio.drive.performance import FPS, FRAMES, frame_times, posture_at
from relit_studio.drive.room import Room
from relit_studio.drive.truth import TruthTracker
from relit_studio.people.landmarks import landmarks
from relit_studio.people.person import Person
from relit_studio.progress import Progress, no_progress

_CHUNK = 12
"""Frames whose shapes are written before they are rendered."""


@dataclass(frozen=True)
class DriveSettings:
    """What a driving video is rendered with.

    Attributes:
        size: width and height of the frames, pixels.
        every: only every so manieth frame of the performance is made, with as many fewer frames a second.
        frames: of the performance, from its beginning.
        quality: one noise seed for all frames, so that nothing flickers.
    """

    size: tuple[int, int] = (960, 540)
    every: int = 1
    frames: int = FRAMES
    quality: Quality = field(default_factory=lambda: Quality(samples=48))

    @property
    def fps(self) -> float:
        """Frames a second of the video."""
        return FPS / self.every


def render_drive(
    person: Person, room: Room, folder: Path, settings: DriveSettings, progress: Progress = no_progress
) -> dict[str, float]:
    """Render the performance into `folder`; frames that are there already are left. Returns seconds by frame.

    `frames/0000.exr` … are linear RGBA, premultiplied over black, in the unit of one-light pictures. From them come
    `clip.mp4` (before the room, exposed for a white ball at 0.8), `track.json` (for the tracker `recorded`) and
    `truth.json`.

    Raises:
        InputError: the folder was begun with other settings.
        DeviceError: Cycles is not set up, or fails.
        StorageError: the folder cannot be written.
    """
    width, height = settings.size
    camera = Camera(height, width)
    keep_settings(folder, "drive.json", _description(person, room, settings, camera))
    make_folder(folder / "frames")
    times = frame_times(settings.frames)[:: settings.every].tolist()
    paths = [folder / "frames" / f"{index * settings.every:04d}.exr" for index in range(len(times))]
    figure, light = Figure(person), room.light(folder)
    scene = figure.scene()
    seconds: dict[str, float] = {}
    missing = [index for index, path in enumerate(paths) if not path.is_file()]
    progress(len(times) - len(missing), len(times))
    for start in range(0, len(missing), _CHUNK):
        chunk = missing[start : start + _CHUNK]
        done = len(times) - len(missing) + start
        pictures = [Picture(paths[index], light, figure.shape(posture_at(times[index]))) for index in chunk]

        def told(made: int, _: int, done: int = done) -> None:
            progress(done + made, len(times))

        seconds |= render(scene, camera, settings.quality, pictures, told)
    write_clip(person, room, camera, folder, paths, times, settings)
    return seconds


def write_clip(
    person: Person,
    room: Room,
    camera: Camera,
    folder: Path,
    paths: list[Path],
    times: list[float],
    settings: DriveSettings,
) -> None:
    """Write the video, the track and the truth of rendered frames.

    Raises:
        ImageError: a frame is damaged.
        StorageError: a file cannot be written.
    """
    tracker, size = TruthTracker(person, camera), camera.size
    recorder, backdrop = TrackRecorder(tracker, size, settings.fps), room.backdrop(camera)
    with VideoWriter(folder / "clip.mp4", size, settings.fps) as writer:
        for index, (path, time_s) in enumerate(zip(paths, times, strict=True)):
            frame = Frame(room.shown(*read_rgba(path), backdrop), index, 0.0, time_s)
            writer.write(frame.image, time_s)
            recorder.add(tracker.track(frame), time_s)
    recorder.write(folder / "track.json")
    write_atomic(folder / "truth.json", json.dumps(_truth(person, room, camera, times, settings)))


def _truth(
    person: Person, room: Room, camera: Camera, times: list[float], settings: DriveSettings
) -> dict[str, object]:
    frames = []
    for time_s in times:
        posture = posture_at(time_s)
        points = camera.project(landmarks(person, posture)["openseeface66"])
        frames.append(
            {
                "time_s": time_s,
                "pose_deg": posture.angles._asdict(),
                "expression": dict(posture.expression),
                "landmarks66_px": points.astype(float).round(3).tolist(),
            }
        )
    return {
        "fps": settings.fps,
        "size_px": list(camera.size),
        "focal_px": camera.focal_px,
        "camera_distance_cm": camera.distance_cm,
        "environment": room.environment.name,
        "environment_yaw_deg": room.yaw_deg,
        "exposure_scale": room.scale,
        "light_map": room.light_map.round(5).astype(float).tolist(),
        "frames": frames,
        "credits": list(manifest().credits.values()),
    }


def _description(person: Person, room: Room, settings: DriveSettings, camera: Camera) -> dict[str, object]:
    return {
        "person": asdict(person.traits),
        "environment": room.environment.name,
        "environment_yaw_deg": room.yaw_deg,
        "settings": {**asdict(settings), "quality": settings.quality.settings()},
        "camera": {**asdict(camera), "focal_px": camera.focal_px},
    }
