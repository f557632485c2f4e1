"""The performances by name."""

from __future__ import annotations

from relit_camera.base.errors import NotFoundError
from relit_studio.drive.performance import Performance
from relit_studio.drive.performances.away import AWAY
from relit_studio.drive.performances.expression_tour import EXPRESSIONS_SHOWN
from relit_studio.drive.performances.hands import HANDS
from relit_studio.drive.performances.meeting import MEETING
from relit_studio.drive.performances.talk import TALK
from relit_studio.drive.performances.turn import TURN

PERFORMANCES = {each.name: each for each in (TALK, TURN, HANDS, AWAY, EXPRESSIONS_SHOWN, MEETING)}


def find_performance(name: str) -> Performance:
    """A performance by name.

    Raises:
        NotFoundError: there is none.
    """
    if name not in PERFORMANCES:
        raise NotFoundError(f"no performance '{name}'", f"use {', '.join(PERFORMANCES)}")
    return PERFORMANCES[name]
