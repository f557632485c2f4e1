"""How far a desk capture is, as the API tells it to the page that shows the patterns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class DeskStage(StrEnum):
    """What a desk capture is doing."""

    IDLE = "idle"
    """None was asked for since the start."""
    EXPOSING = "exposing"
    """The screen is white, and the webcam's exposure is found."""
    FILMING = "filming"
    """One pattern after the other is shown and filmed."""
    BUILDING = "building"
    """The subject is made of the frames; the page may be left."""
    DONE = "done"
    FAILED = "failed"
    """`what` and `cure` say why. Nothing was stored."""
    CANCELED = "canceled"

    @property
    def needs_page(self) -> bool:
        """Whether the page must show patterns now."""
        return self in (DeskStage.EXPOSING, DeskStage.FILMING)

    @property
    def is_running(self) -> bool:
        """Whether a capture is under way."""
        return self.needs_page or self is DeskStage.BUILDING


@dataclass(frozen=True)
class DeskCaptureStatus:
    """The last desk capture that was asked for."""

    stage: DeskStage = DeskStage.IDLE
    subject: str | None = None
    """Name under which the subject is stored once it is done."""
    step: int = 0
    """Which of the steps is to be shown now."""
    steps: int = 0
    patches: tuple[float, ...] = ()
    """Pixel value 0..1 of each patch in this step, row by row from the upper left."""
    columns: int = 0
    rows: int = 0
    what: str = ""
    """What went wrong, or what the person should know, in one clause."""
    cure: str = ""


@dataclass(frozen=True)
class DeskPlace:
    """A screen, and the webcam and the person before it, in centimeters."""

    screen_width_cm: float
    screen_height_cm: float
    distance_cm: float
    """From the eyes to the screen."""
    camera_up_cm: float
    """From the middle of the screen up to the webcam."""
    camera_right_cm: float = 0.0
    one_by_one: bool = False
    """Whether one patch is lit at a time: a calmer screen, a noisier result."""
