"""Expression stills from the end of a capture film, where the person talks and turns in constant light."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from relit_camera.app.captures.expression_capture import capture_expressions
from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import RelitError
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)

STAGE = "Looking at the film's end"


def with_coda_stills(film: Path, told: Mapping[str, Any], subject: Subject, tell: Progress) -> tuple[Subject, str]:
    """Add expression stills of the film's end to the subject that was made of it.

    Args:
        film: the file.
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
    except RelitError as error:  # the subject is whole without them
        log.info("no expression stills: %s", error)
        return subject, f"the film's end, after the flashes, gives no expression stills: {error}"
    shown = ", ".join(captured.selection.covered)
    return replace(subject, stills=captured.stills), f"{len(captured.stills)} expression stills of its end: {shown}"
