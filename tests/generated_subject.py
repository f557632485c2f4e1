"""Generated subjects, each built once while what builds it stays as it is: that takes seconds of a processor."""

from __future__ import annotations

from functools import cache

from relit_camera.lab.bench.synthetic_subject import synthetic_subject
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject, write_subject
from tests.gate.parts import CAPTURE
from tests.made_once import made_once


@cache
def generated_subject(width: int, height: int) -> Subject:
    """The `synthetic_subject` of this size in pixels, read from a file that all who ask share."""
    path = made_once(
        f"generated-{width}x{height}.relit",
        lambda path: write_subject(path, synthetic_subject(width, height)),
        (*CAPTURE, "tests/generated_subject.py"),
    )
    return read_subject(path)


def small_subject() -> Subject:
    """A generated subject of 64 lights, 64 x 80 pixels."""
    return generated_subject(64, 80)
