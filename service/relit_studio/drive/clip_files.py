"""Output files of a driving video, made from its rendered frames: video, matte, track and truth."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Mask
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.face.tracking.track_recording import TrackRecorder
from relit_studio.base.assets.manifest import manifest
from relit_studio.cycles.exr import read_rgba
from relit_studio.drive.performance import FPS
from relit_studio.drive.room import Room
from relit_studio.drive.take import Take
from relit_studio.drive.true_tracker import TruthTracker, frame_truth
from relit_studio.drive.webcam import SENSOR, Webcam

_CRF = 12
"""Better quality than usual, so that measurements do not depend on the encoder."""


def write_clip(
    take: Take, room: Room, folder: Path, frames: Sequence[tuple[Path, float]], webcam_seed: int | None
) -> None:
    """Write `clip.mp4`, `matte.mp4`, `track.json` and `truth.json` into `folder`.

    Args:
        take: what was rendered.
        room: where.
        folder: of the files.
        frames: rendered pictures, linear RGBA premultiplied over black, and their times in seconds, in equal steps.
        webcam_seed: of the noise of a webcam that took them; None for pictures without noise, exposed for a white ball
            at 0.8.

    Raises:
        ImageError: a frame is damaged.
        StorageError: a file cannot be written.
    """
    size, times = take.camera.size, [time_s for _, time_s in frames]
    step = round((times[1] - times[0]) * FPS) if len(times) > 1 else 1
    tracker = TruthTracker(take)
    recorder = TrackRecorder(tracker, size, FPS / step)
    truths = [frame_truth(take, time_s) for time_s in times]
    with ExitStack() as files:
        clip = files.enter_context(VideoWriter(folder / "clip.mp4", size, FPS / step, crf=_CRF))
        matte = files.enter_context(VideoWriter(folder / "matte.mp4", size, FPS / step, crf=_CRF))
        pictures = _plain(take, room, frames) if webcam_seed is None else _filmed(take, room, frames, webcam_seed, step)
        for index, (image, alpha, gains) in enumerate(pictures):
            clip.write(image, times[index])
            matte.write(_gray(alpha), times[index])
            truths[index] |= gains
            recorder.add(tracker.track(Frame(image, index, 0.0, times[index])), times[index])
    recorder.write(folder / "track.json")
    write_atomic(folder / "truth.json", json.dumps(_truth(take, room, FPS / step, webcam_seed) | {"frames": truths}))


Taken = tuple[DisplayImage, Mask, dict[str, Any]]
"""A frame, the person's alpha in it, and the gains it was taken with."""


def _plain(take: Take, room: Room, frames: Sequence[tuple[Path, float]]) -> Iterator[Taken]:
    backdrop = room.backdrop(take.camera)
    for path, _ in frames:
        picture, alpha = read_rgba(path)
        yield room.shown(picture, alpha, backdrop), alpha, {}


def _filmed(take: Take, room: Room, frames: Sequence[tuple[Path, float]], seed: int, step: int) -> Iterator[Taken]:
    behind = room.behind(take.camera)
    webcam: Webcam | None = None
    for index, (path, time_s) in enumerate(frames):
        picture, alpha = read_rgba(path)
        light: LinearImage = picture + (1 - np.clip(alpha, 0, 1))[..., None] * behind
        webcam = webcam or Webcam(seed, light)
        gains = webcam.set_at(time_s)
        told = {"exposure_gain": gains.exposure, "white_balance_gain": list(gains.white_balance)}
        yield webcam.develop(light, gains, index), alpha, told
        webcam.follow(light, step)


def _gray(alpha: Mask) -> DisplayImage:
    codes = np.round(np.clip(alpha, 0, 1) * 255).astype(np.uint8)
    return np.repeat(codes[..., None], 3, axis=2)


def _truth(take: Take, room: Room, fps: float, webcam_seed: int | None) -> dict[str, Any]:
    """Truth of the whole video."""
    camera = take.camera
    return {
        "performance": take.performance.name,
        "fps": fps,
        "size_px": list(camera.size),
        "focal_px": camera.focal_px,
        "camera_distance_cm": camera.distance_cm,
        "environment": room.environment.name,
        "environment_yaw_deg": room.yaw_deg,
        "exposure_scale": room.scale,
        "light_map": room.light_map.round(5).astype(float).tolist(),
        "webcam": None if webcam_seed is None else {"seed": webcam_seed, "sensor": asdict(SENSOR)},
        "credits": list(manifest().credits.values()),
    }
