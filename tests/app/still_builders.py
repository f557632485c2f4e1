"""Builders of expression stills that a worker process can import."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np

from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import CaptureError
from relit_camera.base.storage.atomic_files import atomic_path
from relit_camera.live.status.expression_status import ExpressionReport
from relit_camera.subject.expression_stills import STILL_POINTS, ExpressionStill
from relit_camera.subject.subject_file import write_stills

HALF = b"half a subject"
VIDEO = b"a video"


def grey_still() -> ExpressionStill:
    """A grey picture of an eye's distance."""
    landmarks = np.full((STILL_POINTS, 2), 8.0, np.float32)
    landmarks[33], landmarks[263] = (4, 8), (12, 8)
    none = np.zeros((STILL_POINTS, 3), np.float32)
    light = np.ones((32, 64, 3), np.float32)
    return ExpressionStill(np.full((16, 16, 3), 90, np.uint8), landmarks, none, np.zeros(3, np.float32), light)


def add_still(filmed: object, subject: Path, path: Path) -> ExpressionReport:
    """Add one still."""
    assert filmed == "frames"
    write_stills(subject, path, [grey_still()])
    return ExpressionReport(1, ("wide mouth",), ("open your mouth wide",), path.stat().st_size)


def refuse_stranger(filmed: object, subject: Path, path: Path) -> ExpressionReport:
    """Say that the face is another person's."""
    raise CaptureError("the face in the webcam's picture is not the subject's", "film the person whose subject it is")


def begin_and_wait(filmed: object, subject: Path, path: Path) -> ExpressionReport:
    """Write half a subject, and wait until this process is killed."""
    with atomic_path(path) as unfinished:
        unfinished.write_bytes(HALF)
        threading.Event().wait(120)
    raise AssertionError


def add_slowly(filmed: object, subject: Path, path: Path) -> ExpressionReport:
    """Add one still once there is a file `go` beside the subject's folder."""
    while not (subject.parents[1] / "go").exists():
        threading.Event().wait(0.02)
    return add_still(filmed, subject, path)


def add_of_video(video: Path, subject: Path, path: Path, tell: Progress) -> ExpressionReport:
    """Add one still, if the video is the one that was sent."""
    tell("Following the face", 1, 2)
    if video.read_bytes() != VIDEO:
        raise CaptureError(f"no face was found in {video.name}", "look into the camera")
    return add_still("frames", subject, path)


def wait_with_video(video: Path, subject: Path, path: Path, tell: Progress) -> ExpressionReport:
    """Tell that half is done, and wait until this process is killed."""
    tell("Following the face", 1, 1)
    threading.Event().wait(120)
    raise AssertionError
