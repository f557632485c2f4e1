"""What a user sets up, as the API tells it: checks, devices, source, tracker, models; and who uses the camera."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from relit_camera.devices.webcam_formats import FrameSize


class CheckState(StrEnum):
    """How a check ended."""

    OK = "ok"
    WARNING = "warning"
    """The camera works, but not as well as it could."""
    FAILED = "failed"
    """Something is missing that the settings ask for; until it is there a placeholder is shown, or nothing is
    published."""
    UNKNOWN = "unknown"
    """The check itself failed."""


@dataclass(frozen=True)
class Check:
    """One thing that the camera needs, and whether it is there."""

    id: str
    """For programs, such as `kernel-module`; stays the same when the wording changes."""
    title: str
    state: CheckState
    what: str
    """What was seen, in one clause."""
    cure: str = ""
    """What to do about it."""
    commands: tuple[str, ...] = ()
    """The commands of the cure, in order, to be copied into a terminal."""


@dataclass(frozen=True)
class WebcamItem:
    """A webcam of this machine."""

    device: str
    """Its id, for `PATCH source`; the same after a restart."""
    name: str
    sizes: tuple[FrameSize, ...]
    """The largest first; empty where the driver does not tell."""
    in_use_by: tuple[str, ...]
    """Other programs of the same user that have it open."""
    is_current: bool


@dataclass(frozen=True)
class VirtualCameraItem:
    """A virtual camera of this machine."""

    device: str
    """Its device file."""
    name: str
    """As call apps show it."""
    is_current: bool
    """Whether it is the one that is published to."""


@dataclass(frozen=True)
class DeviceList:
    """The cameras of this machine."""

    webcams: tuple[WebcamItem, ...]
    virtual_cameras: tuple[VirtualCameraItem, ...]


@dataclass(frozen=True)
class SourceStatus:
    """Where live frames come from."""

    device: str
    """A webcam's id, `pattern`, or what `--source` named."""
    width: int
    """In pixels, as asked for; a webcam may give another size."""
    height: int
    fps: float
    """Frames a second, as asked for."""
    frame_width: int
    """Of the frames that really come; as asked for until the first."""
    frame_height: int
    state: str
    """`running`; `released` while nobody looks (on demand); else it is being opened, or searched for."""
    what: str = ""
    """Why no frames come; empty while they do."""
    cure: str = ""


@dataclass(frozen=True)
class TrackerChoice:
    """Which tracker follows the face."""

    name: str
    names: tuple[str, ...]
    """Those that may be chosen."""


class ModelStage(StrEnum):
    """What the pull of public models is doing."""

    IDLE = "idle"
    """None was asked for since the start."""
    PULLING = "pulling"
    DONE = "done"
    FAILED = "failed"
    """`what` and `cure` say why. What could be had is stored."""
    CANCELED = "canceled"

    @property
    def is_running(self) -> bool:
        """Whether a pull is under way."""
        return self is ModelStage.PULLING


@dataclass(frozen=True)
class ModelPullStatus:
    """The public models that the settings need, and how far their pull is."""

    stage: ModelStage = ModelStage.IDLE
    missing: tuple[str, ...] = ()
    """Models that tracker and matte need and that are not stored."""
    progress: float = 0.0
    """0..1 of the file that is fetched."""
    doing: str = ""
    """What is fetched or done now, in one clause."""
    what: str = ""
    """What went wrong."""
    cure: str = ""


@dataclass(frozen=True)
class SpeedAdvice:
    """What to do where the computer does not keep up."""

    what: str
    cure: str
    width: int
    """The size to choose, by `PATCH source`."""
    height: int
