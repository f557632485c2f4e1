"""What may be shown when: one table for the running camera and for replays (docs/reliability.md)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from relit_camera.base.config.look import Mode


class Shown(StrEnum):
    """What is published for a frame."""

    RELIT = "relit"
    """The picture that was asked for."""
    LAST_LIGHT = "last-light"
    """The live picture, the person in the mean factor that they had."""
    PLACE_TINT = "place-tint"
    """The live picture, the person in the mean tint of the place."""
    AT_REST = "at-rest"
    """The subject's source image, relit, unmoved."""
    HELD = "held"
    """The last picture again."""
    FILMED = "filmed"
    """The picture as filmed."""
    PLACEHOLDER = "placeholder"
    """A picture of nobody that says why."""


class FacePresence(StrEnum):
    """Whether the face tells how it is lit, and moves."""

    FOLLOWED = "followed"
    LOST = "lost"
    """It was followed before, and is away, hidden or in profile."""
    NOT_YET = "not yet"


class Rendering(StrEnum):
    """Whether the pipeline gives pictures."""

    WORKS = "works"
    FAILS = "fails"
    """It failed or hangs since a moment ago."""
    HAS_FAILED = "has failed"
    """For so long that the last picture would deceive people."""


@dataclass(frozen=True)
class Situation:
    """What decides what is shown.

    Attributes:
        mode: that was chosen.
        face: of the live person.
        has_subject: whether somebody is chosen, or whoever comes.
        other_person: whether the live person is known to be somebody else than the subject, who is somebody.
        avatar_allowed: others may move the subject's portrait.
        rendering: whether the pipeline gives pictures.
        can_rest: whether the source image can be relit now without the pipeline.
        filmed_allowed: the picture as filmed may be published.
        filmed_when_failing: the settings prefer that to the placeholder.
    """

    mode: Mode
    face: FacePresence = FacePresence.FOLLOWED
    has_subject: bool = True
    other_person: bool = False
    avatar_allowed: bool = False
    rendering: Rendering = Rendering.WORKS
    can_rest: bool = False
    filmed_allowed: bool = False
    filmed_when_failing: bool = False


def what_is_shown(now: Situation) -> Shown:
    """The kind of picture that is shown: of the mode that was chosen, never of the other one.

    Only where that is allowed is a person shown as filmed, or a portrait moved by somebody else.
    """
    if not now.has_subject:
        return Shown.FILMED if now.filmed_allowed else Shown.PLACEHOLDER
    if now.mode is Mode.PORTRAIT and now.other_person and not now.avatar_allowed:
        return Shown.PLACEHOLDER
    if now.rendering is Rendering.WORKS:
        if now.face is FacePresence.FOLLOWED:
            return Shown.RELIT
        if now.mode is Mode.PORTRAIT:
            return Shown.AT_REST
        return Shown.LAST_LIGHT if now.face is FacePresence.LOST else Shown.PLACE_TINT
    if now.mode is Mode.PORTRAIT and now.can_rest:
        return Shown.AT_REST
    if now.rendering is Rendering.FAILS:
        return Shown.HELD
    return Shown.FILMED if now.filmed_when_failing and now.filmed_allowed else Shown.PLACEHOLDER
