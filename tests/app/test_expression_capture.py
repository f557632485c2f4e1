"""Expression stills from a film: whoever else is in it, for however short, is not taken for the subject."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from relit_camera.app.captures.expression_capture import _require_same_person
from relit_camera.base.errors import CaptureError
from relit_camera.capture.expressions.film_tracking import TrackedFilm
from relit_camera.live.reenactment.source_image import SourceFace
from tests.capture.expressions.talking_film import SCHEME, film, moved_points, tracked
from tests.live.people import close_up, face_of

UNLIKE, ALIKE = 0.5, 0.12
"""Residuals of the room's light."""


@cache
def subject() -> SourceFace:
    return face_of(close_up())


def visit(start: int, end: int) -> TrackedFilm:
    """Ten seconds of the subject, another person with a longer face between two frames."""
    own = subject().head_points
    other = own * [1.0, 1.12, 1.0]
    return film(
        *(tracked(i, other if start <= i < end else own) for i in range(300)),
    )


def check(seen: TrackedFilm, chosen: int, residual: float, face: SourceFace | None = None) -> None:
    _require_same_person(seen, [seen.faces[0], seen.faces[chosen]], face or subject(), residual)


@pytest.mark.slow
def test_a_still_of_somebody_who_visits_for_five_seconds_is_refused() -> None:
    seen = visit(120, 270)
    check(seen, 40, UNLIKE)
    with pytest.raises(CaptureError, match="is not the subject's"):
        check(seen, 195, UNLIKE)


@pytest.mark.slow
def test_a_grimace_and_a_face_that_light_explains_pass() -> None:
    check(visit(120, 270), 195, ALIKE)
    faces = [tracked(i, moved_points(open_cm=1.5) if i % 30 == 0 else SCHEME.canonical) for i in range(120)]
    neutral = film(*faces)
    own = replace(subject(), head_points=np.array(SCHEME.canonical))
    check(neutral, 60, UNLIKE, own)
