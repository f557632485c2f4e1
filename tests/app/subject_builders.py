"""Builders of instant subjects for tests of the capture: another process imports this file, so it imports little."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import atomic_path
from relit_camera.subject.compression.local_basis import global_basis
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.rungs import Rung
from relit_camera.subject.subject import Subject, SubjectMetadata
from relit_camera.subject.subject_file import write_subject

TWO_LIGHTS = np.array([[0, 0, 1], [1, 0, 0]], np.float32)


def captured(rung: Rung | None, light_directions: NDArray[np.float32] = TWO_LIGHTS) -> Subject:
    """A grey subject of 16 x 24 pixels, captured by lights from `light_directions` (lights, 3)."""
    matte, lights = np.ones((24, 16), np.float32), len(light_directions)
    return Subject(
        metadata=SubjectMetadata(
            width=16,
            height=24,
            method="nearest",
            lights=lights,
            components=1,
            source="webcam",
            psnr_db=60.0,
            rung=rung,
            created_by="test",
            created_at="2026-01-01",
        ),
        basis=global_basis(np.ones((3, 1, 24, 16), np.float16), matte),
        coefficients=np.ones((1, TEXELS), np.float32),
        light_directions=light_directions,
        light_coefficients=np.ones((1, lights), np.float32),
        matte=matte,
        neutral=np.full((24, 16, 3), 90, np.uint8),
    )


def build(frames: Sequence[DisplayImage], path: Path) -> Sequence[str]:
    assert len(frames) == 3
    write_subject(path, captured("instant"))
    return ["the room's light is hard: turn toward the window"]


def refuse(frames: Sequence[DisplayImage], path: Path) -> Sequence[str]:
    raise CaptureError("no face is in the frames", "look at the camera")


def refuse_once(frames: Sequence[DisplayImage], path: Path) -> Sequence[str]:
    before = path.parent / ".tried"
    if before.exists():
        return build(frames, path)
    before.touch()
    raise CaptureError("no face is in the frames", "look at the camera")


def take_long(frames: Sequence[DisplayImage], path: Path) -> Sequence[str]:
    with atomic_path(path) as unfinished:
        unfinished.write_bytes(b"half a subject")
        threading.Event().wait(60)
    return []
