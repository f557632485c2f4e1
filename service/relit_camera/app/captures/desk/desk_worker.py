"""What the worker process of a desk capture does; it imports none of the camera's own modules, to start sooner."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def write_desk_subject(frames: Sequence[bytes], setup: str, path: Path) -> Sequence[str]:
    """Build a subject of the JPEG frames of a desk capture and write its file.

    Args:
        frames: in the order of filming, of one size.
        setup: JSON of `capture.desk.desk_recording.DeskSetup`.
        path: of the subject's file.

    Returns:
        What the person should know, a clause each.

    Raises:
        CaptureError: no usable face or no patterns are in them.
        ModelError: the networks that find the face are missing.
        StorageError: the file cannot be written.
    """
    from relit_camera.capture.desk.desk_capture import build_desk_subject
    from relit_camera.capture.desk.desk_recording import DeskRecording, DeskSetup, EncodedFrames
    from relit_camera.subject.subject_file import write_subject

    recording = DeskRecording(DeskSetup.model_validate_json(setup), EncodedFrames(frames))
    subject, warnings = build_desk_subject(recording, "the webcam before the screen")
    write_subject(path, subject)
    return warnings
