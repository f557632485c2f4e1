"""Bodies of requests and answers, but for those that `base.config.look` and `live.status.camera_status` define."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from relit_camera.base.config.look import Background, Lighting, Mode, NoBackground, StoredName, SubjectName
from relit_camera.subject.rungs import Rung
from relit_camera.subject.subject import SubjectMetadata


class ApiModel(BaseModel):
    """Base class of the bodies: immutable, unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class ModeBody(ApiModel):
    """How the relit face reaches the picture."""

    mode: Mode


class FreezeBody(ApiModel):
    """Whether the published picture stands still."""

    frozen: bool


class SubjectChoice(ApiModel):
    """Who is shown."""

    name: SubjectName | None
    """A stored subject, `anyone` for whoever comes, or null for nobody.

    For nobody a placeholder is shown, or the live picture where that is allowed; in mode portrait for `anyone` too.
    """


class CurrentSubject(ApiModel):
    """Who is shown now."""

    name: str | None
    """The subject's name, which may be that of a file given on the command line, or `anyone`; null for nobody."""


class SubjectItem(ApiModel):
    """A stored subject."""

    name: str
    is_current: bool
    temporary: bool
    """From a file named on the command line, for this run only."""
    thumbnail: str
    """Path of a JPEG picture."""


class SubjectDetails(SubjectItem):
    """A stored subject and what its file says."""

    metadata: SubjectMetadata
    stills: int
    """Number of its expression stills."""


class InstantCaptureRequest(ApiModel):
    """A subject to be captured from the webcam."""

    name: StoredName = "instant"
    """Under which it is stored; an instant subject of that name is replaced."""


class DeskCaptureRequest(ApiModel):
    """A subject to be captured by the light of the screen that shows the page."""

    name: StoredName = "desk"
    """Under which it is stored; an instant or desk subject of that name is replaced."""
    screen_width_cm: Annotated[float, Field(ge=8, le=200)]
    """Of the screen's lit area."""
    screen_height_cm: Annotated[float, Field(ge=5, le=120)]
    distance_cm: Annotated[float, Field(ge=20, le=200)]
    """From the eyes to the screen."""
    camera_up_cm: Annotated[float, Field(ge=-200, le=200)]
    """From the middle of the screen up to the webcam."""
    camera_right_cm: Annotated[float, Field(ge=-200, le=200)] = 0.0
    """From there to the right, as you see it."""
    one_by_one: bool = False
    """Light one patch at a time: a calmer screen, a noisier result."""


class ShownStep(ApiModel):
    """What the page with the patterns shows."""

    step: Annotated[int, Field(ge=-1, le=1000)]
    """Index of the step; -1 for none yet."""


class EnvironmentItem(ApiModel):
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


class BackgroundPicture(ApiModel):
    """A stored background picture."""

    name: str
    is_current: bool
    thumbnail: str
    """Path of a JPEG picture."""


class PresetItem(ApiModel):
    """A stored preset."""

    name: str
    at_start: bool
    """Whether it is shown when the camera starts; at most one is."""


class PresetChanges(ApiModel):
    """What changes of a preset: only the fields that are given."""

    name: StoredName = "preset"
    """Its new name."""
    at_start: bool = False
    """Shown when the camera starts, in place of another one; or no more."""


class SceneBody(ApiModel):
    """Everything that can be changed while the camera runs, as it now stands: the `scene` event."""

    revision: int
    """Counts changes."""
    lighting: Lighting
    background: Background
    mode: Mode
    subject: str | None
    rung: Rung | None
    """How the subject was captured; null for nobody, and where its file does not say."""
    unlit_allowed: bool
    """Whether the picture as filmed may be published: without a subject or a face, and before and after."""
    avatar_allowed: bool
    """Whether others than the subject may move the portrait, in mode portrait."""
    frozen: bool
    can_undo: bool
    can_redo: bool


class SceneChanges(ApiModel):
    """What changes of the scene, in one step: only the fields that are given."""

    lighting: Lighting = Lighting()
    """Only the given fields change; `lamps` is replaced as a whole."""
    background: Background = NoBackground()
    """Replaced as a whole."""
    mode: Mode = Mode.LIVE
    subject: SubjectName | None = None
    """A stored subject, `anyone` for whoever comes, or null for nobody."""
    frozen: bool = False
    unlit_allowed: bool = False
    """Whether the picture as filmed may be published: a person must have confirmed that. Not kept over a restart."""
    avatar_allowed: bool = False
    """Whether others than the subject may move the portrait: a person must have confirmed that. It is withdrawn where
    another subject is chosen, and not kept over a restart."""


class Health(ApiModel):
    """The process answers."""

    status: Literal["alive"] = "alive"


class Readiness(ApiModel):
    """Pictures are being published."""

    status: Literal["ready"] = "ready"
