"""What a person changes while the camera runs: lighting, background, mode. API, presets and config.yaml share it."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from relit_camera.base.storage.named_files import NAME_PATTERN, require_portable_name

ColorChannel = Annotated[float, Field(ge=0, le=100)]
LinearRgb = tuple[ColorChannel, ColorChannel, ColorChannel]
StoredName = Annotated[str, Field(pattern=NAME_PATTERN), AfterValidator(require_portable_name)]
"""A stored thing's name: letters, digits, space, dot, dash, underscore; no dot or space last, and no device of Windows,
so that it is safe as a file name everywhere."""


ANYONE = "anyone"
"""The name, and the method, of the subject that is nobody's: whoever comes is relit."""
SubjectName = Annotated[str, Field(min_length=1, max_length=120, pattern=r"^[^/\\\x00-\x1f]+$")]
"""A subject's name, which may be that of any file put into the folder by hand."""


class SettingsModel(BaseModel):
    """Base of every settings model: immutable, unknown keys refused, NaN and infinity refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


class Mode(StrEnum):
    """How the relit face reaches the picture.

    The former names `ratio` (live) and `reenact` (portrait) are still accepted.
    """

    LIVE = "live"
    """The live frame itself, multiplied by the ratio of target light to room light."""
    PORTRAIT = "portrait"
    """The subject's source image, relit and moved as the live face moves. The webcam's picture stays private: nothing
    of the room, or of today's hair and clothes, is sent."""

    @classmethod
    def _missing_(cls, value: object) -> Mode | None:
        match value:
            case "ratio":
                return cls.LIVE
            case "reenact":
                return cls.PORTRAIT
        return None


class Lamp(SettingsModel):
    """A round lamp at infinity."""

    model_config = ConfigDict(
        json_schema_extra={
            "not": {
                "required": ["kelvin", "color"],
                "properties": {"kelvin": {"type": "number"}, "color": {"type": "array"}},
            }
        }
    )

    azimuth_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    """0 is from the camera, 90 from the picture's right."""
    elevation_deg: Annotated[float, Field(ge=-90, le=90)] = 30.0
    size_deg: Annotated[float, Field(gt=0, le=180)] = 10.0
    """Full angle of the disc."""
    kelvin: Annotated[float, Field(ge=1667, le=25000)] | None = None
    """Colour temperature; its colour has luminance 1. Give this or `color`, not both; neither is white."""
    color: LinearRgb | None = None
    """Linear RGB, multiplied by `intensity` as it is."""
    intensity: Annotated[float, Field(ge=0, le=1000)] = 1.0
    """Irradiance at the head, perpendicular to the lamp."""
    muted: bool = False
    """Gives no light, and keeps its settings."""
    name: Annotated[str, Field(max_length=40, pattern=r"^[^\x00-\x1f\x7f]*$")] = ""
    """What a person calls it."""

    @model_validator(mode="after")
    def _kelvin_or_color(self) -> Lamp:
        if self.kelvin is not None and self.color is not None:
            raise ValueError("give kelvin or color, not both")
        return self


class Lighting(SettingsModel):
    """The light that falls on the face."""

    environment: StoredName | None = "studio"
    """A stored environment, `background` to be lit by the virtual background, or null for lamps only."""
    yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    """Turns the environment: yaw > 0 moves a frontal light to the picture's right."""
    pitch_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    roll_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    exposure_ev: Annotated[float, Field(ge=-10, le=10)] = 0.0
    """Relative to a white ball facing the camera reading 0.8."""
    saturation: Annotated[float, Field(ge=0, le=4)] = 1.0
    """Of the light: 0 is grey light, 1 as it is."""
    lamps: Annotated[tuple[Lamp, ...], Field(max_length=16)] = ()
    face_gain_ev: Annotated[float, Field(ge=-10, le=10)] = 0.0
    background_gain_ev: Annotated[float, Field(ge=-10, le=10)] = 0.0
    blend: Annotated[float, Field(ge=0, le=1)] = 1.0
    """0 the live picture (in portrait, where that stays private, the source image as captured), 1 fully relit. In live
    below 0.05 only where the picture as filmed may be published."""
    split: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Before and after, in mode live: this share of the picture, from its left, is as filmed, room and all. Above 0
    only where the picture as filmed may be published."""
    transition_s: Annotated[float, Field(ge=0, le=60)] = 0.4
    """Seconds over which a change is eased."""


def _with_kind_required(schema: dict[str, Any]) -> None:
    """Say in a JSON schema that `kind` must be given: it tells the kinds of a background apart."""
    schema["required"] = ["kind", *schema.get("required", [])]


class KindOfBackground(SettingsModel):
    """Base of the kinds of backgrounds."""

    model_config = ConfigDict(json_schema_extra=_with_kind_required)


class NoBackground(KindOfBackground):
    """Portrait: a dark neutral. Live: the live room."""

    kind: Literal["none"] = "none"


class BlurBackground(KindOfBackground):
    """The live room, blurred."""

    kind: Literal["blur"] = "blur"
    strength: Annotated[float, Field(gt=0, le=1)] = 0.5
    """1 blurs with a sigma of a tenth of the picture's height."""


class ColorBackground(KindOfBackground):
    """One colour."""

    kind: Literal["color"] = "color"
    color: Annotated[str, Field(pattern=r"^#[0-9A-Fa-f]{6}$")] = "#202428"
    """SRGB, as in a web page."""


class ImageBackground(KindOfBackground):
    """A picture, cropped to fill."""

    kind: Literal["image"] = "image"
    image: StoredName
    """A stored background picture or a stored environment's name."""


class EnvironmentBackground(KindOfBackground):
    """The environment that lights the face, seen behind it and turned with it."""

    kind: Literal["environment"] = "environment"
    height_deg: Annotated[float, Field(ge=10, le=120)] = 35.0
    """Vertical field of view."""
    blur: Annotated[float, Field(ge=0, le=1)] = 0.15


Background = Annotated[
    NoBackground | BlurBackground | ColorBackground | ImageBackground | EnvironmentBackground,
    Field(discriminator="kind"),
]


class Look(SettingsModel):
    """What is changed while the camera runs, but for the subject."""

    lighting: Lighting = Lighting()
    background: Background = NoBackground()
    mode: Mode = Mode.LIVE

    @property
    def shows_filmed(self) -> bool:
        """Whether a part of the picture would be as it was filmed, or all of it but for a trace."""
        light = self.lighting
        return light.split > 0 or (self.mode is Mode.LIVE and light.blend < LEAST_RELIT_BLEND)

    def relit(self) -> Look:
        """The same look where it shows nothing as filmed; else with all of the picture relit."""
        if not self.shows_filmed:
            return self
        faint = self.mode is Mode.LIVE and self.lighting.blend < LEAST_RELIT_BLEND
        changes = {"split": 0.0, "blend": 1.0 if faint else self.lighting.blend}
        return self.model_copy(update={"lighting": self.lighting.model_copy(update=changes)})


LEAST_RELIT_BLEND = 0.05
"""Below this `blend` the picture of mode live is as filmed for the eye: it differs by a few codes."""


class Preset(Look):
    """A look that is kept, with who is shown in it."""

    subject: SubjectName | None = None
    """A stored subject's name; null leaves whoever is shown."""

    @property
    def look(self) -> Look:
        """The look alone."""
        return Look(lighting=self.lighting, background=self.background, mode=self.mode)


def merge_edits(look: Look, before: Look, after: Look) -> Look:
    """The present look with every field that differs between `before` and `after`; in the lighting field by field."""
    lighting = look.lighting.model_copy(update=_changed_fields(before.lighting, after.lighting))
    parts = _changed_fields(before, after)
    return look.model_copy(update=parts | {"lighting": lighting})


def _changed_fields(before: SettingsModel, after: SettingsModel) -> dict[str, Any]:
    values = {name: getattr(after, name) for name in type(after).model_fields}
    return {name: value for name, value in values.items() if value != getattr(before, name)}
