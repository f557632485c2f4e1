"""How far a replay is, the relighting of a video that was sent, as the API tells it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class ReplayStage(StrEnum):
    """What a replay is doing."""

    RECEIVING = "receiving"
    """The video is being sent."""
    WORKING = "working"
    """Its frames are relit."""
    DONE = "done"
    """The relit video is stored."""
    FAILED = "failed"
    """It is not; `what` and `cure` say why."""
    CANCELED = "canceled"

    @property
    def is_running(self) -> bool:
        """Whether it is under way."""
        return self in (ReplayStage.RECEIVING, ReplayStage.WORKING)


@dataclass(frozen=True)
class ReplayStatus:
    """A video that was relit, or is being relit."""

    name: str
    """Of the result."""
    stage: ReplayStage
    progress: float = 0.0
    """Share of the frames that are done, 0 to 1; stays 0 where the file does not say how many there are."""
    frames: int = 0
    """Number of frames that are done."""
    video: str | None = None
    """Path of the relit video once it is done."""
    what: str = ""
    """What went wrong, or what the person should know, in one clause."""
    cure: str = ""
    """What to do about it."""
