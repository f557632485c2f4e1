"""Builders of desk subjects that a worker process can import."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

from relit_camera.app.captures.desk.desk_worker import write_desk_subject
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_files import decode_display
from relit_camera.base.storage.atomic_files import atomic_path
from relit_camera.capture.desk.desk_recording import DeskSetup
from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import captured

HALF = b"half a subject"
SMALL_PX = 128


def check_and_build(frames: Sequence[bytes], setup: str, path: Path) -> Sequence[str]:
    """A subject, if there are frames of every pattern, and the light in them is the patterns'."""
    read = DeskSetup.model_validate_json(setup)
    if len(frames) < 2 * len(read.patterns) or "Gain" not in read.locked:
        raise CaptureError(f"{len(frames)} frames, {read.locked} held", "a fault of the test")
    levels = [float(decode_display(frame).mean()) for frame in frames]
    if max(levels) < 150 or min(levels) > 60:
        raise CaptureError(f"levels of {min(levels):.0f} to {max(levels):.0f}", "a fault of the test")
    write_subject(path, captured("desk"))
    return ["it was bright"]


def write_small_subject(frames: Sequence[bytes], setup: str, path: Path) -> Sequence[str]:
    """What the camera's own builder writes, at half its width and height: most of the time goes into pixels."""
    with patch("relit_camera.capture.desk.desk_capture.SIZE_PX", SMALL_PX):
        return write_desk_subject(frames, setup, path)


def refuse_desk(frames: Sequence[bytes], setup: str, path: Path) -> Sequence[str]:
    """Say that the person left."""
    raise CaptureError("the person left", "come back")


def begin_and_wait(frames: Sequence[bytes], setup: str, path: Path) -> Sequence[str]:
    """Write half a subject, and wait until this process is killed."""
    with atomic_path(path) as unfinished:
        unfinished.write_bytes(HALF)
        threading.Event().wait(120)
    return []
