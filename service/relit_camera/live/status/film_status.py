"""How far a capture from a film is, and what came of it, as the API tells it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

Circle = tuple[float, float, float]
"""x, y and radius in pixels of the upright film."""


class FilmStage(StrEnum):
    """What a capture from a film is doing."""

    IDLE = "idle"
    """There is no film."""
    RECEIVING = "receiving"
    """The film is being sent."""
    READING = "reading"
    """Pictures under one light each are made of the film."""
    BUILDING = "building"
    """The subject is made of these pictures."""
    DONE = "done"
    """The subject is stored; `report` says how good it is."""
    FAILED = "failed"
    """It is not; `what` and `cure` say why. Nothing was stored."""
    CANCELED = "canceled"
    INTERRUPTED = "interrupted"
    """The camera ended meanwhile; it can be resumed."""

    @property
    def is_running(self) -> bool:
        """Whether a capture is under way."""
        return self in (FilmStage.RECEIVING, FilmStage.READING, FilmStage.BUILDING)


@dataclass(frozen=True)
class FilmOptions:
    """How to read the film, as the options of `relit capture build` of the same names say."""

    light_distance_cm: float = 100.0
    ball_diameter_cm: float | None = None
    balls: int = 1
    focal_px: float | None = None
    size: int = 384
    ball: Circle | None = None
    second_ball: Circle | None = None
    face: Circle | None = None


@dataclass(frozen=True)
class FilmStep:
    """One of the steps of the work, in their order."""

    name: str
    state: Literal["waiting", "running", "done"] = "waiting"
    seconds: float = 0.0
    """How long it took, or has taken so far."""


@dataclass(frozen=True)
class DroppedFrames:
    """Frames of the film that were not used, for one reason."""

    count: int
    why: str


@dataclass(frozen=True)
class FilmReport:
    """What came of a film."""

    verdict: Literal["good", "usable", "again"]
    """Whether to keep the subject, or to film again."""
    because: str
    """Why, in one sentence; what to do better where it is not good."""
    directions: int
    """Distinct directions of light that the film has."""
    covered_fraction: float
    """Share of the half sphere before the face from which light was filmed."""
    expected_db: float | None
    """Mean PSNR under environments that subjects from films reach on people whose truth is known."""
    frames: int
    """Number of frames of the film."""
    used: int
    """How many of them show the person under the lamp and were used."""
    dropped: tuple[DroppedFrames, ...] = ()
    """Frames that were not used, the most frequent reason first. Dark frames between two flashes are none of them."""
    warnings: tuple[str, ...] = ()
    """What may have made the subject worse, and what to do about it, a sentence each."""
    pictures: tuple[str, ...] = ()
    """Paths of JPEG pictures of the subject, each in another light."""
    coda: str = ""
    """What the film's end, after the flashes, gave: expression stills, or why none; empty where it ends with them."""
    lights: tuple[tuple[float, float, float], ...] = ()
    """Where the lamp was in each frame that was used: unit vectors from the face, X right in the picture, Y up, and Z
    toward the camera."""


@dataclass(frozen=True)
class FilmCaptureStatus:
    """The last film that was sent."""

    stage: FilmStage = FilmStage.IDLE
    subject: str | None = None
    """Name under which the subject is stored once it is done."""
    film: str | None = None
    """Name of the film's file as it was sent."""
    stages: tuple[FilmStep, ...] = ()
    """The steps of the work in their order."""
    progress: float = 0.0
    """Share of the work that is done, 0 to 1, by the time that it usually takes."""
    what: str = ""
    """What went wrong, in one clause."""
    cure: str = ""
    """What to do about it."""
    can_resume: bool = False
    """Whether the film is still there, so that the work can go on, or begin again with other options."""
    report: FilmReport | None = None
