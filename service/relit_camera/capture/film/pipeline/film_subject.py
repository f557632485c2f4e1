"""From a film to a subject: samples, kept on disk until the subject is made, then the field."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from relit_camera.capture.film.pipeline.capture_options import CaptureOptions, Progress
from relit_camera.capture.film.pipeline.checkpoint import Checkpoint, CheckpointFolder
from relit_camera.capture.film.pipeline.film_capture import build_samples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.subject.subject import Subject

BUILDING = "Building the field"
"""Name of the stage that follows those of `build_samples`."""


def build_film_subject(
    film: Path,
    options: CaptureOptions,
    checkpoints: CheckpointFolder,
    progress: Progress,
    method: str = "default",
    source: str | None = None,
) -> tuple[Subject, dict[str, Any]]:
    """The subject of a film, and the capture's report; it goes on from a checkpoint of the same input.

    Args:
        film: the file.
        options: how to read it.
        checkpoints: the folder of the checkpoint.
        progress: told the stage, what of it is done, and its total.
        method: name of a reflectance method.
        source: what the film is called in the subject's header; its file's name if not given.

    Raises:
        VideoError: the film cannot be read, is cut off or damaged, or shows no face.
        CaptureError: something is missing in it; the message says what to do differently.
        InputError: an option is impossible.
        NotFoundError: no such method.
    """
    checkpoint = checkpoints.read()
    if checkpoint is None:
        read = build_samples(film, options, progress)
        checkpoint = Checkpoint(read.samples, read.findings.report())
        checkpoints.write(checkpoint)
    progress(BUILDING, 0, None)
    subject = build_subject(
        checkpoint.samples,
        method,
        source or film.name,
        options.gamma,
        rung="film",
        progress=partial(progress, BUILDING),
    )
    return subject, checkpoint.report
