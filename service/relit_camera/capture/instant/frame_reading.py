"""Frames for an instant subject: from a picture, the beginning of a video, or a few seconds of a webcam."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_files import LDR_SUFFIXES, read_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoReader, probe_video
from relit_camera.devices.sources.source import Source
from relit_camera.devices.sources.source_factory import open_source


@dataclass(frozen=True)
class ReadingTunables:
    """How many frames are taken.

    Attributes:
        most: frames that are kept.
        video_s: seconds of a video that are looked at.
        webcam_s: seconds of a webcam that are looked at.
        settling_s: seconds before these, in which a webcam finds its exposure.
        first_frame_s: how long a webcam may take until its first frame.
        longest_side_px: larger frames are reduced to it: a face needs no more.
        threads: of the decoder.
    """

    most: int = 60
    video_s: float = 10.0
    webcam_s: float = 3.0
    settling_s: float = 1.0
    first_frame_s: float = 8.0
    longest_side_px: int = 1280
    threads: int = 2


TUNABLES = ReadingTunables()
READ_TIMEOUT_S = 0.2
Progress = Callable[[str, int, int | None], None]


@dataclass(frozen=True)
class ReadFrames:
    """Frames of one size.

    Attributes:
        frames: (height, width, 3) uint8, in order of time.
        source: what people call their source: a file's name, or the camera's.
    """

    frames: list[DisplayImage]
    source: str


def read_frames(
    source: str,
    settings: SourceSettings,
    progress: Progress = lambda stage, done, total: None,
    open_live: Callable[[SourceSettings], Source] = open_source,
) -> ReadFrames:
    """Read a picture or video file that exists; any other name is a live source's, as `relit run --source` takes it.

    Raises:
        DeviceError: there is no such camera, or it gives no pictures: another program may be using it.
        ImageError, VideoError: the file cannot be read.
    """
    path = Path(source).expanduser()
    if path.is_file():
        if path.suffix.lower() in LDR_SUFFIXES:
            return ReadFrames([_reduced(read_display(path))], path.name)
        return ReadFrames(_video_frames(path, progress), path.name)
    try:
        live = open_live(settings.model_copy(update={"source": source}))
    except DeviceError as error:
        raise DeviceError(error.what, "plug a webcam in, or name a video or picture of yourself") from error
    return _live_frames(live, progress)


def _video_frames(path: Path, progress: Progress) -> list[DisplayImage]:
    info = probe_video(path)
    expected = min(info.frames or math.inf, TUNABLES.video_s * info.fps)
    every = max(1, math.ceil(expected / TUNABLES.most))
    kept: list[DisplayImage] = []
    with VideoReader(path, threads=TUNABLES.threads, only=range(0, sys.maxsize, every)) as reader:
        for frame in reader:
            if frame.time_s > TUNABLES.video_s:
                break
            kept.append(_reduced(frame.image))
            progress("Reading the video", len(kept), TUNABLES.most)
            if len(kept) == TUNABLES.most:
                break  # before what comes is decoded, which may be damaged
    return kept


def _live_frames(source: Source, progress: Progress) -> ReadFrames:
    """A few seconds of a live source. It is closed afterwards."""
    kept: list[DisplayImage] = []
    begun, last, silent_s = None, -math.inf, 0.0
    try:
        name = source.describe().id
        while silent_s < TUNABLES.first_frame_s:
            frame = source.read(READ_TIMEOUT_S)
            if frame is None:
                silent_s += READ_TIMEOUT_S
                continue
            silent_s = 0.0
            begun = frame.time_s if begun is None else begun
            since_s = frame.time_s - begun - TUNABLES.settling_s
            if since_s >= TUNABLES.webcam_s:
                return ReadFrames(kept, name)
            if since_s >= 0 and frame.time_s - last >= TUNABLES.webcam_s / TUNABLES.most:
                kept.append(_reduced(frame.image))
                last = frame.time_s
                progress("Look into the camera", round(10 * since_s), round(10 * TUNABLES.webcam_s))
        raise DeviceError(
            source.reason or f"{name} gives no pictures",
            "close the program that uses the camera, or choose another (`relit devices`)",
        )
    finally:
        source.close()


def _reduced(image: DisplayImage) -> DisplayImage:
    """The picture, its longer side no more than `longest_side_px`."""
    scale = TUNABLES.longest_side_px / max(image.shape[:2])
    if scale >= 1:
        return image
    size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
