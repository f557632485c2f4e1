"""What the worker process of a capture of expression stills does; its imports come late, so that it starts sooner."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from relit_camera.app.captures.expressions.guided_filming import FilmedStills
from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.live.status.expression_status import ExpressionReport

if TYPE_CHECKING:
    from relit_camera.app.captures.expression_capture import ExpressionCapture


def write_filmed_stills(filmed: FilmedStills, subject: Path, path: Path) -> ExpressionReport:
    """Make stills of the webcam's frames, and write the subject's file with them.

    Args:
        filmed: the frames.
        subject: the subject's file.
        path: to write to.

    Returns:
        What the stills show.

    Raises:
        CaptureError: the face is another person's.
        SubjectError: no face is found in the subject, or it cannot be read.
        ModelError: the networks are missing.
        StorageError: the file cannot be written.
    """
    from relit_camera.app.captures.expression_capture import take_stills
    from relit_camera.base.images.image_files import decode_display
    from relit_camera.subject.subject_file import read_subject

    pictures = ((index, decode_display(data)) for index, data in filmed.frames.items())
    return _write(take_stills(read_subject(subject), filmed.film, filmed.selection, pictures), subject, path)


def write_video_stills(video: Path, subject: Path, path: Path, tell: Progress) -> ExpressionReport:
    """Make stills of a video, and write the subject's file with them; see `write_filmed_stills`.

    Raises:
        VideoError: the video cannot be read.
        CaptureError: no face is in it, another person's, or one that is too small, too dark or does too little.
        RelitError: as `write_filmed_stills`.
    """
    from relit_camera.app.captures.expression_capture import capture_expressions
    from relit_camera.subject.subject_file import read_subject

    return _write(capture_expressions(video, read_subject(subject), tell), subject, path)


def _write(captured: ExpressionCapture, subject: Path, path: Path) -> ExpressionReport:
    from relit_camera.capture.expressions.live_prompts import NEUTRAL
    from relit_camera.subject.subject_file import write_stills

    write_stills(subject, path, captured.stills)
    selection = captured.selection
    return ExpressionReport(len(captured.stills), (NEUTRAL, *selection.covered), selection.missing, path.stat().st_size)
