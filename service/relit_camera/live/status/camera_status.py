"""What the running camera says of itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum


class CameraState(StrEnum):
    """What is being published."""

    STARTING = "starting"
    LIVE = "live"
    """Relit pictures of a tracked face."""
    SEARCHING = "searching"
    """The source gives pictures, but no face is tracked: the subject eases to neutral."""
    WAITING = "waiting"
    """The source gives no pictures: the placeholder is shown."""
    STANDING_IN = "standing-in"
    """Pictures fail or hang: the relit still is shown, or what `output.fallback` says, until they come again."""
    RELEASED = "released"
    """On demand, and nobody looks: the webcam is released, the placeholder is shown."""
    FROZEN = "frozen"
    STOPPING = "stopping"


@dataclass(frozen=True)
class Degradation:
    """Something that works less well than asked: what, why, and what cures it."""

    what: str
    why: str
    cure: str = ""


@dataclass(frozen=True)
class TrackerStatus:
    """Name of the tracker and found, uncertain or lost."""

    name: str
    state: str


@dataclass(frozen=True)
class Rates:
    """Frames a second: what the source gives, the pipeline makes, and the sink gets."""

    camera: float
    pipeline: float
    published: float


@dataclass(frozen=True)
class Percentiles:
    """Milliseconds over the last few hundred frames."""

    p50: float
    p95: float


@dataclass(frozen=True)
class FrameCounts:
    """Since the start: pictures sent, frames passed over for newer ones, pictures sent again for want of a new one."""

    published: int
    dropped: int
    repeated: int


@dataclass(frozen=True)
class CameraStatus:
    """The answer of GET /api/v1/status."""

    state: CameraState
    source: str
    sink: str
    subject: str | None
    mode: str
    tracker: TrackerStatus
    fps: Rates
    latency_ms: Percentiles
    """From a frame's arrival to its publication."""
    stage_ms: dict[str, Percentiles]
    frames: FrameCounts
    providers: dict[str, str] = field(default_factory=dict)
    """Model name → execution provider that was proven to run it."""
    degraded: list[Degradation] = field(default_factory=list)
    version: str = ""
    uptime_s: float = 0.0
