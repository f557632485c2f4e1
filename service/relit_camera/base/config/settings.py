"""The settings that are fixed for one run of the camera: source and sink of pictures, models, server, folders."""

from __future__ import annotations

from enum import StrEnum
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Literal, Self

from platformdirs import user_data_path
from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_settings import BaseSettings, SettingsConfigDict

from relit_camera.base.config.look import ANYONE, Look, SettingsModel

EvenSize = Annotated[int, Field(ge=64, le=8192, multiple_of=2)]
HostAndPort = Annotated[str, Field(pattern=r"^([a-z0-9.-]{1,253}|\[[0-9a-f:.]+\])(:[0-9]{1,5})?$")]
"""A host as a browser names it: lower case, an IPv6 address in brackets, the port where it is not ours or the usual."""


class SourceSettings(SettingsModel):
    """Where live pictures come from."""

    source: str = "webcam"
    """`webcam`, a camera's id from `relit devices`, a video or picture file, `pattern`, or a plug-in's `NAME` or
    `NAME:ARGUMENT`."""
    width: EvenSize = 1280
    """Asked of a webcam; it may answer with another size."""
    height: EvenSize = 720
    fps: Annotated[float, Field(ge=1, le=240)] = 30.0
    on_demand: bool = False
    """Release the webcam while nobody reads the virtual camera or watches a preview (Linux)."""


class Fallback(StrEnum):
    """What is shown where not even the source image can be relit."""

    PLACEHOLDER = "placeholder"
    FILMED = "filmed"
    """The webcam's picture as it is: yourself and your room. Its former name, `live`, is still accepted."""

    @classmethod
    def _missing_(cls, value: object) -> Fallback | None:
        return cls.FILMED if value == "live" else None


class OutputSettings(SettingsModel):
    """Where relit pictures go."""

    sink: str = "camera"
    """`camera` (what call apps can see: PipeWire and v4l2loopback, each where it is there), `pipewire`, a video file to
    write, `null`, or a plug-in's `NAME` or `NAME:ARGUMENT`."""
    label: Annotated[str, Field(min_length=1, max_length=31)] = "Relit Camera"
    """Name of the virtual camera, as call apps show it."""
    width: EvenSize = 1280
    """Even, and fixed for the whole run: readers of the virtual camera break otherwise."""
    height: EvenSize = 720
    fps: Annotated[float, Field(ge=1, le=120)] = 30.0
    keep_s: Annotated[float, Field(ge=0, le=3600)] = 60.0
    """The virtual camera goes on for so many seconds when the program is killed, upgraded or restarted: with the last
    picture for ten seconds, then with the placeholder (Linux). 0 switches its keeper off."""
    placeholder: Path | None = None
    """Picture shown while there is nothing else to show; a built-in one if not given."""
    fallback: Fallback = Fallback.PLACEHOLDER
    """While pictures cannot be made the last one is held, or in portrait the source image is shown, relit; after that,
    this: `placeholder`, or `filmed`, the webcam's picture as it is, room and all, if `unlit_allowed` is true too."""
    unlit_allowed: bool = False
    """Whether the picture as filmed may be published: without a subject, while pictures fail, before and after
    (`split`). The panel can allow it for one run."""
    avatar_allowed: bool = False
    """Whether others than the subject may move the portrait (mode portrait): an actor and an avatar. The panel can
    allow it for one subject."""

    @field_validator("sink", mode="before")
    @classmethod
    def _null_as_text(cls, sink: object) -> object:
        return "null" if sink is None else sink  # YAML reads the bare word as no value


class TrackerSettings(SettingsModel):
    """How the face is tracked."""

    name: str = "mesh"
    """`mesh`, `openseeface`, `recorded:FILE.json`, or a plug-in's `NAME` or `NAME:ARGUMENT`."""
    dead_band_deg: Annotated[float, Field(ge=0, le=5)] = 0.3
    """Head turns smaller than this do not move the light."""
    reach_yaw_deg: Annotated[float, Field(ge=5, le=80)] = 40.0
    """Beyond this turn the picture eases to neutral."""
    reach_pitch_deg: Annotated[float, Field(ge=5, le=80)] = 30.0


class RelightSettings(SettingsModel):
    """How the subject is relit."""

    name: str = "auto"
    """`auto` (`onnx-basis` where a GPU is proven to run it, else `basis`), `basis`, `onnx-basis`, `dense`, or a
    plug-in's `NAME` or `NAME:ARGUMENT`."""


class ReenactSettings(SettingsModel):
    """How the source image is moved."""

    name: str = "first-order"
    """`first-order`, `onnx:FILE.onnx` (docs/reenactors.md), or a plug-in's `NAME` or `NAME:ARGUMENT`."""
    model: Path | None = None
    """An ONNX reenactor of your own: the same as `name: onnx:FILE.onnx`."""

    @model_validator(mode="after")
    def _one_reenactor(self) -> Self:
        if self.model is not None and self.name != "first-order":
            raise ValueError("give a name or a model, not both")
        return self

    @property
    def reenactor(self) -> str:
        """The reenactor that both settings together name."""
        return self.name if self.model is None else f"onnx:{self.model}"


class InferenceSettings(SettingsModel):
    """How ONNX Runtime runs."""

    provider: Literal["auto", "cpu", "cuda", "tensorrt", "directml", "coreml", "openvino"] = "auto"
    strict: bool = False
    """Fail where the provider is not really used, instead of falling back to the CPU with a warning."""
    threads: Annotated[int, Field(ge=1, le=64)] = 1
    """Threads of each model; the picture arithmetic has the other cores."""


class ServerSettings(SettingsModel):
    """The REST API and the panel."""

    host: str = "127.0.0.1"
    """Address to listen on. Any other than a loopback address needs a token: the preview shows your home."""
    port: Annotated[int, Field(ge=0, le=65535)] = 8470
    """0 picks a free port and prints it."""
    token_file: Path | None = None
    """A file with the token that clients must show, which other users of the machine may not read."""
    token: SkipJsonSchema[Annotated[SecretStr | None, Field(exclude=True)]] = None
    """The token itself, from the environment only: RELIT_SERVER__TOKEN."""
    names: Annotated[tuple[HostAndPort, ...], Field(max_length=16)] = ()
    """Other names by which clients reach the server, such as `camera.lan` or, behind a proxy, `camera.example:8443`."""

    @property
    def is_loopback(self) -> bool:
        """Whether only programs of this machine can reach the address."""
        if self.host == "localhost":
            return True
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return False


class StorageSettings(SettingsModel):
    """Where environments, subjects, backgrounds and presets are kept."""

    data_dir: Path = Field(default_factory=lambda: user_data_path("relit-camera", appauthor=False))
    quota_gb: Annotated[float, Field(gt=0, le=100_000)] = 20.0
    """Gigabytes: an upload that would not fit into the data folder, as it is when it begins, is refused."""

    @property
    def folders(self) -> tuple[Path, ...]:
        """All in which files are written."""
        captures = (self.film_capture, self.expression_capture)
        return self.environments, self.subjects, self.backgrounds, self.presets, *captures, self.replays

    @property
    def environments(self) -> Path:
        """Folder of stored environments."""
        return self.data_dir / "environments"

    @property
    def subjects(self) -> Path:
        """Folder of stored subjects."""
        return self.data_dir / "subjects"

    @property
    def backgrounds(self) -> Path:
        """Folder of stored background pictures."""
        return self.data_dir / "backgrounds"

    @property
    def presets(self) -> Path:
        """Folder of stored presets."""
        return self.data_dir / "presets"

    @property
    def film_capture(self) -> Path:
        """Folder of the film that a subject is made of, and of what is made of it."""
        return self.data_dir / "captures" / "film"

    @property
    def expression_capture(self) -> Path:
        """Folder of the video that expression stills are made of."""
        return self.data_dir / "captures" / "expressions"

    @property
    def replays(self) -> Path:
        """Folder of relit videos."""
        return self.data_dir / "replays"


class RelitSettings(BaseSettings):
    """The whole configuration. Precedence: defaults < config.yaml < RELIT_* environment < command line.

    In the environment a nested field is written with two underscores: RELIT_SERVER__PORT=9000.
    """

    model_config = SettingsConfigDict(
        env_prefix="RELIT_", env_nested_delimiter="__", extra="forbid", frozen=True, use_attribute_docstrings=True
    )

    source: SourceSettings = SourceSettings()
    output: OutputSettings = OutputSettings()
    subject: str | None = ANYONE
    """A stored subject's name, the path of a .relit file, `anyone`: whoever comes, or null: nobody."""
    look: Look = Look()
    tracker: TrackerSettings = TrackerSettings()
    matte: str = "selfie"
    """What finds the person in the live picture (mode live): `selfie`, or `recorded:FILE.npz`."""
    pull_models: Literal["ask", "always", "never"] = "ask"
    """Whether commands get public models that they need and that are missing: `ask` does so on a terminal, once."""
    relight: RelightSettings = RelightSettings()
    reenact: ReenactSettings = ReenactSettings()
    inference: InferenceSettings = InferenceSettings()
    server: ServerSettings = ServerSettings()
    storage: StorageSettings = StorageSettings()
    log_level: Literal["debug", "info", "warning", "error"] = "info"

    @property
    def named_subject(self) -> str | None:
        """The subject, where it is one person's."""
        return None if self.subject == ANYONE else self.subject
