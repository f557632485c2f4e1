"""Expression stills from the end of a capture film, where the person talks and turns in constant light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from relit_camera.app.background_job import describe_failure
from relit_camera.app.captures.expression_capture import capture_expressions
from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.subject.subject import Subject

STAGE = "Looking at the film's end"


def with_coda_stills(
    film: Path, file_name: str, told: Mapping[str, Any], subject: Subject, tell: Progress
) -> tuple[Subject, str]:
    """Add expression stills of the film's end to the subject that was made of it.

    Args:
        film: the file.
        file_name: what people know it by.
        told: the capture's report, `capture.film.pipeline.capture_report.CaptureFindings.report`.
        subject: made of the film.
        tell: told the stage, what of it is done, and its total.

    Returns:
        The subject, and what was found, as a clause; the same subject where the film's end gives no stills, and why. An
        empty clause where the film ends with the flashes.
    """
    first = told.get("coda")
    if first is None:
        return subject, ""
    try:
        captured = capture_expressions(film, subject, lambda stage, done, total: tell(STAGE, done, total), first)
    except Exception as error:  # also a fault: the subject is whole without them
        what, cure = describe_failure("expression stills", error, {str(film): file_name, film.name: file_name})
        return subject, f"the film's end, after the flashes, gives no expression stills: {what}; {cure}"
    return replace(subject, stills=captured.stills), f"{len(captured.stills)} expression stills were taken of its end"
