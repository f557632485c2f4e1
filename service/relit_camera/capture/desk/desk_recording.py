"""Desk recordings: a folder of webcam frames, filmed while a screen showed patterns, and its `desk.json`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from relit_camera.base.errors import CaptureError, ImageError
from relit_camera.base.images.image_files import LDR_SUFFIXES, decode_display, read_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.capture.desk.patterns.pattern_sequence import Pattern, check_pattern, standard_sequence

SETUP_NAME = "desk.json"
MAX_SETUP_BYTES = 1 << 20
MAX_FRAMES = 3000
"""Frames of a recording: 100 seconds at 30 a second."""
MIN_FRAME_SIDE_PX, MAX_FRAME_SIDE_PX = 120, 4096

Centimetres = Annotated[float, Field(ge=-200, le=200)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


class Screen(_Part):
    """The lit area of the screen and its display curve: light = ((p + black)^gamma) for a pixel value p of 0..1."""

    width_cm: Annotated[float, Field(ge=8, le=200)]
    height_cm: Annotated[float, Field(ge=5, le=120)]
    gamma: Annotated[float, Field(ge=1, le=4)] = 2.2
    black: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """What is added to every pixel value: a backlight that shines through black."""


class CameraPlace(_Part):
    """Where the webcam is, from the middle of the screen as the person sees it; it looks straight out of the screen."""

    right_cm: Centimetres = 0.0
    up_cm: Centimetres
    """A webcam on top of the screen has half the screen's height and a little more."""


class PatchGrid(_Part):
    """The patches, which divide the screen evenly; patch 0 is the upper left one as the person sees it, row by row."""

    columns: Annotated[int, Field(ge=2, le=8)] = 5
    rows: Annotated[int, Field(ge=2, le=6)] = 3

    @property
    def count(self) -> int:
        """Number of patches."""
        return self.columns * self.rows


class FacePlace(_Part):
    """A circle about the face, brow to chin, in pixels of a frame."""

    x: Annotated[float, Field(ge=0)]
    y: Annotated[float, Field(ge=0)]
    radius: Annotated[float, Field(gt=4)]


class DeskSetup(_Part):
    """The file `desk.json`: what was before the webcam, and what the screen showed."""

    format_version: Literal[1] = 1
    screen: Screen
    distance_cm: Annotated[float, Field(ge=20, le=200)]
    """From the eyes to the screen."""
    camera: CameraPlace
    patches: PatchGrid = PatchGrid()
    sequence: Annotated[list[Pattern], Field(min_length=4, max_length=200)] | None = None
    """The patterns in the order in which they were shown; null for the standard sequence of the patches."""
    shown: Annotated[list[int | None], Field(max_length=MAX_FRAMES)] | Literal["unknown"] = "unknown"
    """For each frame the index of its pattern in the sequence, null for none; "unknown" is told apart in the pictures.
    """
    camera_gamma: Literal["srgb", "linear"] | Annotated[float, Field(ge=0.2, le=5)] = "srgb"
    """Curve that the webcam's codes are decoded with."""
    locked: list[Annotated[str, Field(max_length=100)]] = []
    """Controls of the webcam that were held while filming; for information."""
    face: FacePlace | None = None
    """Where the face is; null has it detected."""
    pixels_per_cm: Annotated[float, Field(gt=0.5, le=200)] | None = None
    """Scale of a frame at the face; null has it from the distance of the eyes."""
    room_picture: Annotated[str, Field(max_length=200)] | None = None
    """A picture in the folder of the person in the room's own light, the screen dark; null has it from the frames."""

    @model_validator(mode="after")
    def _consistent(self) -> DeskSetup:
        for index, pattern in enumerate(self.sequence or ()):
            check_pattern(pattern, self.patches.count, f"sequence[{index}]")
        if self.shown != "unknown":
            count = len(self.patterns)
            for frame, shown in enumerate(self.shown):
                if shown is not None and not 0 <= shown < count:
                    raise ValueError(f"shown[{frame}] is {shown}, the sequence has {count} patterns")
        if self.room_picture is not None and not re.fullmatch(r"[^/\\\x00]+", self.room_picture):
            raise ValueError("room_picture must be the name of a file in the folder")
        return self

    @property
    def patterns(self) -> list[Pattern]:
        """The sequence, or the standard one."""
        return self.sequence or standard_sequence(self.patches.columns, self.patches.rows)


class FrameSequence(Protocol):
    """Frames of one size by index: uint8 (height, width, 3) in the webcam's own codes, RGB."""

    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> DisplayImage: ...


@dataclass(frozen=True)
class DeskRecording:
    """What was filmed at a desk.

    Attributes:
        setup: screen, distance, camera and patterns.
        frames: of the webcam, in the order of filming.
        room: the person in the room's own light, (height, width, 3) of the frames' size; None where there is none.
    """

    setup: DeskSetup
    frames: FrameSequence
    room: DisplayImage | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a frame in pixels."""
        height, width = self.frames[0].shape[:2]
        return width, height


@dataclass(frozen=True)
class FrameFolder:
    """Picture files as frames, read when they are asked for.

    Attributes:
        paths: of the files.
        shape: (height, width, 3) that each must have.
    """

    paths: Sequence[Path]
    shape: tuple[int, ...]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.paths)

    def __getitem__(self, index: int, /) -> DisplayImage:
        """The frame.

        Raises:
            CaptureError: its size is not that of the first.
            ImageError: it cannot be read.
        """
        frame = read_display(self.paths[index])
        if frame.shape != self.shape:
            sizes = [f"{shape[1]}x{shape[0]}" for shape in (frame.shape, self.shape)]
            what = f"{self.paths[index].name} is {sizes[0]}, the first frame is {sizes[1]}"
            raise CaptureError(what, "film all frames at one size")
        return frame


@dataclass(frozen=True)
class EncodedFrames:
    """JPEG or PNG frames in memory, decoded when they are asked for.

    Attributes:
        data: of each frame.
    """

    data: Sequence[bytes]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.data)

    def __getitem__(self, index: int, /) -> DisplayImage:
        """The frame.

        Raises:
            ImageError: it is no picture.
        """
        return decode_display(self.data[index], f"frame {index}")


def read_desk_recording(folder: Path) -> DeskRecording:
    """The recording in a folder: `desk.json`, and the frames in the order of their file names.

    Raises:
        CaptureError: the folder, its `desk.json` or its frames are missing or not as they must be.
        ImageError: the first frame or the picture of the room cannot be read.
    """
    if not folder.is_dir():
        raise CaptureError(f"there is no folder {folder}", f"name a folder of frames with a {SETUP_NAME}")
    setup = _read_setup(folder / SETUP_NAME)
    try:
        paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in LDR_SUFFIXES)
    except OSError as error:
        raise CaptureError(f"{folder} cannot be read: {error.strerror}", "check your permission to read it") from error
    paths = [path for path in paths if path.name != setup.room_picture]
    if not len(setup.patterns) <= len(paths) <= MAX_FRAMES:
        what = f"{folder} holds {len(paths)} frames"
        cure = f"its patterns need {len(setup.patterns)} to {MAX_FRAMES}"
        raise CaptureError(what, f"{cure}: film again" if len(paths) < MAX_FRAMES else f"{cure}: leave some out")
    if setup.shown != "unknown" and len(setup.shown) != len(paths):
        what = f"{folder} holds {len(paths)} frames, shown in {SETUP_NAME} lists {len(setup.shown)}"
        raise CaptureError(what, 'list each frame, or write "unknown"')
    shape = read_display(paths[0]).shape
    if min(shape[:2]) < MIN_FRAME_SIDE_PX or max(shape[:2]) > MAX_FRAME_SIDE_PX:
        what = f"{paths[0].name} is {shape[1]}x{shape[0]}"
        raise CaptureError(what, f"frames have {MIN_FRAME_SIDE_PX} to {MAX_FRAME_SIDE_PX} pixels a side")
    room = None
    if setup.room_picture is not None:
        room = FrameFolder([folder / setup.room_picture], shape)[0]
    return DeskRecording(setup, FrameFolder(paths, shape), room)


def _read_setup(path: Path) -> DeskSetup:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_SETUP_BYTES + 1)
    except OSError as error:
        cure = "a recording has one beside its frames: see docs/formats.md"
        raise CaptureError(f"{path} cannot be read: {error.strerror}", cure) from error
    if len(data) > MAX_SETUP_BYTES:
        raise CaptureError(f"{path} is larger than {MAX_SETUP_BYTES >> 20} MiB", "it must be a small JSON file")
    try:
        return DeskSetup.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "the file"
        raise CaptureError(f"{path}: {place}: {first['msg']}", "docs/formats.md has every field") from error


def require_frame(recording: DeskRecording, index: int) -> DisplayImage:
    """A frame of a recording, as an array that is checked.

    Raises:
        ImageError: it is not (height, width, 3) uint8.
    """
    frame = recording.frames[index]
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8:
        raise ImageError(f"frame {index} has shape {frame.shape} {frame.dtype}", "frames are uint8 RGB")
    return frame
