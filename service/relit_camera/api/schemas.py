"""Bodies of requests and answers that `config.look` and `stream.status` do not have."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from relit_camera.config.look import Background, Lighting, Mode, Name
from relit_camera.subject.subject import SubjectMetadata


class Body(BaseModel):
    """Base of the bodies here: immutable, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class ModeBody(Body):
    """How the relit face reaches the picture."""

    mode: Mode


class FreezeBody(Body):
    """Whether the published picture stands still."""

    frozen: bool


class SubjectChoice(Body):
    """Who is shown."""

    name: Name | None
    """A stored subject, or null for nobody: then the live picture passes through unlit."""


class CurrentSubject(Body):
    """Who is shown now."""

    name: str | None
    """The subject's name, which may be that of a file given on the command line; null for nobody."""


class SubjectItem(Body):
    """A stored subject."""

    name: str
    is_current: bool
    thumbnail: str
    """Path of a JPEG picture."""


class SubjectDetails(SubjectItem):
    """A stored subject and what its file says."""

    metadata: SubjectMetadata


class EnvironmentItem(Body):
    """A stored environment."""

    name: str
    builtin: bool
    """Ours: it can be neither replaced nor deleted."""
    temporary: bool
    """From a file named on the command line, for this run only."""
    is_current: bool
    thumbnail: str
    """Path of a JPEG picture, as seen from inside."""


class EnvironmentDetails(EnvironmentItem):
    """A stored environment and what is to be known of it."""

    width: int
    height: int
    clipped_fraction: float
    """Share of the sphere where the file is clipped at white; 0 for .hdr and .exr."""
    notes: list[str]


class BackgroundPicture(Body):
    """A stored background picture."""

    name: str
    is_current: bool
    thumbnail: str
    """Path of a JPEG picture."""


class PresetItem(Body):
    """A stored preset."""

    name: str


class SceneBody(Body):
    """Everything that can be changed while the camera runs, as it now stands: the `scene` event."""

    revision: int
    """Counts changes."""
    lighting: Lighting
    background: Background
    mode: Mode
    subject: str | None
    frozen: bool


class Health(Body):
    """The process answers."""

    status: Literal["alive"] = "alive"


class Readiness(Body):
    """Pictures are being published."""

    status: Literal["ready"] = "ready"
