"""How far a capture is that runs beside the camera, as the API tells it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class CaptureStage(StrEnum):
    """What a capture is doing."""

    IDLE = "idle"
    """None was asked for since the start."""
    FILMING = "filming"
    """Frames of the webcam are kept: the person should look at the camera and hold still."""
    BUILDING = "building"
    """The subject is made of them."""
    DONE = "done"
    """The subject is stored."""
    FAILED = "failed"
    """It is not; `what` and `cure` say why. Nothing was stored."""
    CANCELED = "canceled"

    @property
    def is_running(self) -> bool:
        """Whether a capture is under way."""
        return self in (CaptureStage.FILMING, CaptureStage.BUILDING)


@dataclass(frozen=True)
class CaptureStatus:
    """The last capture that was asked for."""

    stage: CaptureStage = CaptureStage.IDLE
    subject: str | None = None
    """Name under which the subject is stored once it is done."""
    what: str = ""
    """What went wrong, or what the person should know, in one clause."""
    cure: str = ""
    """What to do about it."""
