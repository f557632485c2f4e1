"""A replay case: a folder with a `case.yaml` that says what to replay and what must come out (docs/replay-tests.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import yaml
from pydantic import Field, ValidationError, model_validator

from relit_camera.base.config.look import Mode, SettingsModel
from relit_camera.base.rotations import Angles

CASES = Path(__file__).parent / "cases"
FILE = "case.yaml"

Angle = Annotated[float, Field(ge=-180, le=180)]
Share = Annotated[float, Field(ge=0, le=1)]
FrameNumber = Annotated[int, Field(ge=0)]
Pixel = Annotated[int, Field(ge=0)]
Part = tuple[Pixel, Pixel, Pixel, Pixel]
"""A rectangle of a frame: left, top, right, bottom in pixels, the last two not within."""


class CaseError(Exception):
    """A case's folder cannot be used; the message names the file and the field."""


class Bounds(SettingsModel):
    """Between which angles, in degrees, the pose of every frame must lie; an angle left out is not looked at."""

    yaw: tuple[Angle, Angle] | None = None
    pitch: tuple[Angle, Angle] | None = None
    roll: tuple[Angle, Angle] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Bounds:
        for name in Angles._fields:
            pair = getattr(self, name)
            if pair is not None and pair[0] > pair[1]:
                raise ValueError(f"{name}: the lower bound comes first")
        return self


class Pose(SettingsModel):
    """What the head's pose relative to neutral must be."""

    track: str | None = None
    """A CSV file in the case's folder with the columns frame, yaw, pitch, roll; `record` writes it."""
    tolerance_deg: Annotated[float, Field(gt=0, le=90)] = 0.5
    """By how much an angle may differ from that file's."""
    bounds: Bounds | None = None
    jitter_deg: Annotated[float, Field(gt=0)] | None = None
    """The most that an angle's second difference from frame to frame may be in the median frame."""


class Pictures(SettingsModel):
    """Which relit frames are kept, as `expected/NNNN.jpg`, and how alike a new run's must be."""

    frames: Annotated[tuple[FrameNumber, ...], Field(min_length=1)]
    min_psnr_db: Annotated[float, Field(gt=0, le=100)] = 30.0
    """In linear light over the whole frame, the expected frame's 99.5th percentile being 1."""


class Colours(SettingsModel):
    """What mean colour parts of the relit frames have: for cases whose pictures may not be kept here."""

    track: str
    """A CSV file in the case's folder with the columns frame, part, red, green, blue; `record` writes it."""
    frames: Annotated[tuple[FrameNumber, ...], Field(min_length=1)]
    parts: Annotated[dict[str, Part], Field(min_length=1)]
    tolerance: Annotated[float, Field(gt=0, le=1)] = 0.03
    """By how much red, green and blue may differ, in linear light, white being 1."""


class Expected(SettingsModel):
    """What must come out."""

    found: Share = 1.0
    """Least share of the frames in which the face is found."""
    degraded: str | None = None
    """A word of what must have been reported as working less well than asked; without it nothing may be."""
    pose: Pose | None = None
    pictures: Pictures | None = None
    colours: Colours | None = None


class Case(SettingsModel):
    """What to replay. Places are relative to the case's folder, or `shared:PATH`, or `generated:mannequin`."""

    description: str
    clip: str
    subject: str
    """A .relit file, or an .lp file of one-light pictures, which is imported."""
    gamma: str = "srgb"
    """Curve of the one-light pictures."""
    environment: str
    """A stored environment's name, or the place of a panorama."""
    yaw_deg: Angle = 0.0
    """Turns the environment."""
    background: str = "none"
    mode: Mode
    tracker: str
    """`mesh`, `openseeface`, or `recorded:PLACE`."""
    expect: Expected

    @property
    def uses_shared(self) -> bool:
        """Whether data that lies outside the repository is needed."""
        return any(place.startswith("shared:") for place in (self.clip, self.subject, self.environment))


def case_folders(root: Path = CASES) -> list[Path]:
    """The folders of all cases, in order of their names."""
    return sorted(path.parent for path in root.glob(f"*/{FILE}"))


def read_case(folder: Path) -> Case:
    """Read the case of a folder.

    Raises:
        CaseError: there is none, or a field is unknown, missing or wrong; the message says which.
    """
    path = folder / FILE
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        return Case.model_validate(document)
    except OSError as error:
        raise CaseError(f"cannot read {path}: {error.strerror}") from error
    except yaml.YAMLError as error:
        raise CaseError(f"{path} is no YAML: {error}") from error
    except ValidationError as error:
        wrong = [f"{'.'.join(map(str, item['loc'])) or 'the file'}: {item['msg']}" for item in error.errors()]
        raise CaseError(f"{path}: {'; '.join(wrong)}") from error
