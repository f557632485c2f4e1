"""Every reader of files that may come from somebody else, by the kind of file."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from relit_camera.base.config.preset_store import read_preset
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.base.images.image_files import decode_display, read_linear, read_mask
from relit_camera.base.video.video_readers import LinearVideoReader, VideoReader
from relit_camera.capture.lights_file import read_lights
from relit_camera.capture.subject_landmarks import read_landmarks
from relit_camera.face.matting import RecordedMatting
from relit_camera.face.tracking.track_recording import read_track
from relit_camera.light.environments.environment_panorama import read_panorama
from relit_camera.subject.subject_file import read_metadata, read_neutral, read_subject


def _display(path: Path) -> None:
    decode_display(path.read_bytes())


def _video(path: Path) -> None:
    with VideoReader(path) as video:
        for _ in video:
            pass


def _linear_video(path: Path) -> None:
    with LinearVideoReader(path) as video:
        for _ in video:
            pass


def _subject(path: Path) -> None:
    read_subject(path, copied=True)


def read_preset_file(path: Path) -> None:
    read_preset(path)


def _settings(path: Path) -> None:
    load_settings(path)


def _landmarks(path: Path) -> None:
    read_landmarks(path, required=True)


_KEPT: list[object] = []


def _harm(path: Path) -> None:
    """Do everything that a reader must not."""
    _KEPT.append(path.open("rb"))
    path.with_name("b.txt").write_text("left")
    began = time.process_time()
    while time.process_time() < began + 1.1:
        pass
    np.ones(100 << 20, np.uint8)
    raise ZeroDivisionError


def _die(path: Path) -> None:
    os._exit(7)


READERS: dict[str, tuple[Callable[[Path], object], ...]] = {
    "picture": (_display, read_linear, read_mask),
    "panorama": (read_panorama,),
    "exr": (read_panorama, read_linear),
    "hdr": (read_panorama, read_linear),
    "subject": (_subject, read_metadata, read_neutral),
    "matte": (RecordedMatting,),
    "video": (_video, _linear_video),
    "yaml": (read_preset_file, _settings),
    "track": (read_track,),
    "lights": (read_lights,),
    "landmarks": (_landmarks,),
    "harmful": (_harm,),
    "deadly": (_die,),
}
"""Kind of file → what reads it. Each returns or raises an InputError; `read_preset_file` also a ValueError."""
