"""What the worker process of an instant capture does; it imports none of the camera's own modules, to start sooner."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from relit_camera.base.images.image_types import DisplayImage


def write_instant_subject(frames: Sequence[DisplayImage], path: Path) -> Sequence[str]:
    """Build a subject of a person's frames (uint8 sRGB RGB, one size) and write its file.

    Returns:
        What the person should know, a clause each: that the light is too hard, for example.

    Raises:
        CaptureError: no usable face is in them.
        ModelError: the networks that find it are missing.
        StorageError: the file cannot be written.
    """
    from relit_camera.capture.instant.instant_capture import capture_instant
    from relit_camera.subject.subject_file import write_subject

    captured = capture_instant(frames, "the webcam's picture")
    write_subject(path, captured.subject)
    return captured.warnings
