"""How far a capture of expression stills is, and what came of it, as the API tells it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class ExpressionStage(StrEnum):
    """What a capture of expression stills is doing."""

    IDLE = "idle"
    """None was asked for since the start."""
    RECEIVING = "receiving"
    """A video is being sent."""
    FILMING = "filming"
    """The webcam films: the person should do what `say` says."""
    BUILDING = "building"
    """The stills are made of the frames, or of the video."""
    DONE = "done"
    """The subject has them; `report` says which."""
    FAILED = "failed"
    """It has not; `what` and `cure` say why. The subject is as before."""
    CANCELED = "canceled"

    @property
    def is_running(self) -> bool:
        """Whether a capture is under way."""
        return self in (ExpressionStage.RECEIVING, ExpressionStage.FILMING, ExpressionStage.BUILDING)


@dataclass(frozen=True)
class ExpressionReport:
    """The stills that a subject has got."""

    stills: int
    """How many there are."""
    covered: tuple[str, ...]
    """Names of what they show, of `items`."""
    missing: tuple[str, ...]
    """What to do another time for the rest, a clause each."""
    file_bytes: int
    """Size of the subject's file."""


@dataclass(frozen=True)
class ExpressionCaptureStatus:
    """The last capture of expression stills that was asked for."""

    stage: ExpressionStage = ExpressionStage.IDLE
    subject: str | None = None
    """Name of the stored subject that gets them."""
    film: str | None = None
    """Name of the video's file as it was sent; null for the webcam."""
    prompt: str = ""
    """While the webcam films: the one of `items` that is due."""
    say: str = ""
    """What the person should do for it, as a clause."""
    face: bool = False
    """While the webcam films: whether the face is seen."""
    items: tuple[str, ...] = ()
    """Names of all that stills may show, in the order in which it is asked for. Right and left are the person's."""
    covered: tuple[str, ...] = ()
    """Those of them that the frames show so far."""
    progress: float = 0.0
    """Share of the work that is done, 0 to 1."""
    what: str = ""
    """What went wrong, or what the person should know, in one clause."""
    cure: str = ""
    """What to do about it."""
    report: ExpressionReport | None = None
