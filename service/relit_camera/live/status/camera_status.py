"""The state of the running camera, as `GET /api/v1/status` gives it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from relit_camera.devices.sinks.sink import Readers
from relit_camera.live.status.setup_status import SpeedAdvice
from relit_camera.subject.light_trust import LightTrust


class CameraState(StrEnum):
    """What is being published."""

    STARTING = "starting"
    LIVE = "live"
    """Relit pictures of a tracked face."""
    SEARCHING = "searching"
    """The source gives frames, but no face is tracked: the subject eases to the neutral pose."""
    WAITING = "waiting"
    """The source gives no frames: the placeholder is shown."""
    FALLBACK = "standing-in"
    """The pipeline fails or hangs: until it works again the relit source image is shown, or where that fails too, what
    `output.fallback` says."""
    RELEASED = "released"
    """On demand, and nobody reads the camera: the webcam is released, the placeholder is shown."""
    CAPTURING = "capturing"
    """A first subject is being captured, and nothing may be shown unlit: the placeholder says so."""
    NO_SUBJECT = "no-subject"
    """Nobody is chosen, and nothing may be shown unlit: the placeholder says so."""
    OTHER_PERSON = "other-person"
    """Somebody else than the subject is before the camera, and may not move the portrait: the placeholder says so."""
    FROZEN = "frozen"
    STOPPING = "stopping"


class DegradationCode(StrEnum):
    """What works less well than asked, for programs: stays the same when the wording changes."""

    SOURCE_FAILED = "source-failed"
    """The source gives no frames."""
    PICTURE_FAILED = "picture-failed"
    """The pipeline fails or hangs: the fallback is shown."""
    SINK_FAILED = "sink-failed"
    """The sink takes no pictures; it is tried again."""
    ONE_CAMERA_FAILED = "one-camera-failed"
    """A virtual camera that is there takes no pictures, while another one does; it is tried again."""
    KEEPER_FAILED = "keeper-failed"
    """There is no keeper: a call may end when the camera is killed or restarted."""
    MODELS_MISSING = "models-missing"
    """Models that the tracker needs are not stored: no face is tracked until they are."""
    CONFIGURATION_FAILED = "configuration-failed"
    """The configuration file was edited and cannot be used, or counts only from the next start."""
    NO_SUBJECT = "no-subject"
    """No subject is chosen: a placeholder is shown, or the picture as filmed where that is allowed."""
    OTHER_PERSON = "other-person"
    """Somebody else than the subject is before the camera: in mode live lit as anybody would be, in mode portrait not
    shown."""
    ROOM_NOT_PARTED = "room-not-parted"
    """The matting model is not stored: a room that is kept is lit as the person is."""
    PROVIDER_FALLBACK = "provider-fallback"
    """A model runs on a slower execution provider than asked."""
    REDUCED_QUALITY = "reduced-quality"
    """The computer is busy: pictures are given less detail so that they stay in time."""


@dataclass(frozen=True)
class Degradation:
    """Something that works less well than asked: a code for programs, and what, why and what cures it for people."""

    code: DegradationCode = field(kw_only=True)
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
    """Frames a second: what the source gives, the pipeline makes, the sink gets, and how many of those are new."""

    camera: float
    pipeline: float
    published: float
    """With pictures that are sent again for want of a new one."""
    new: float = 0.0
    """Without them."""


@dataclass(frozen=True)
class Percentiles:
    """Milliseconds over the last few hundred frames."""

    p50: float
    p95: float
    max: float


@dataclass(frozen=True)
class FrameCounts:
    """Counts since the start.

    Attributes:
        published: pictures sent.
        dropped: frames passed over for newer ones.
        repeated: pictures sent again for want of a new one; counted in `published` too.
        composed: pictures made, sent or not.
    """

    published: int
    dropped: int
    repeated: int
    composed: int = 0


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
    """How long each stage takes."""
    frames: FrameCounts
    stage_processor_s: dict[str, float] = field(default_factory=dict)
    """Processor time that each stage has used since the start, without that of stages within it."""
    providers: dict[str, str] = field(default_factory=dict)
    """Name of each open model → the execution provider that is proven to run it, such as `cpu`; and `relighter NAME`,
    the relighter at work → `numpy` or such a provider."""
    unlit: bool = False
    """Whether the published picture is as filmed, or a part of it: without a subject or a face, or by `split`."""
    quality_level: int = 0
    """0 is full quality; at each further level a picture costs less, because the computer is busy."""
    degraded: list[Degradation] = field(default_factory=list)
    readers: Readers = field(default_factory=Readers)
    """Programs that take pictures from the virtual camera."""
    advice: SpeedAdvice | None = None
    """What to do where the computer has not kept up for some seconds."""
    light: LightTrust | None = None
    """How far the subject is to be trusted in the present light; null without a subject, and where no light is on."""
    version: str = ""
    uptime_s: float = 0.0
