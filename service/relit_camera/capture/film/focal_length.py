"""How long the camera's focal length is, and where that is known from.

The focal length that a phone writes into its video.

Apple's cameras write `com.apple.quicktime.camera.focal_length.35mm_equivalent` into the video track ("26", "50.00mm":
see AVMetadataIdentifier.quickTimeMetadataCameraFocalLength35mmEquivalent); FFmpeg reports such items only where they
belong to the whole file. No other maker is known to write one.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from relit_camera.base.errors import InputError, VideoError

FILM_DIAGONAL_MM = 43.27
"""Of 36x24 mm film, by whose diagonal equivalent focal lengths are reckoned (CIPA DCG-001)."""
TYPICAL_MM, TYPICAL_ERROR = 31.0, 0.25
"""A phone's main camera is a 24 to 28 mm lens for stills; a video keeps the width, not the height, and stabilising cuts
a tenth away: about 31 mm of what is left, give or take a quarter with the makes."""
TAG_ERROR = 0.08
"""The tag tells of stills. What stabilising cuts away from a video, it does not say."""
OPTION_ERROR = 0.02


@dataclass(frozen=True)
class FocalLength:
    """A focal length.

    Attributes:
        pixels: of the upright picture.
        error: relative standard error.
        source: where it is from, for people.
    """

    pixels: float
    error: float
    source: str

    @property
    def log(self) -> float:
        """Natural logarithm of the pixels."""
        return float(np.log(self.pixels))

    def scaled(self, factor: float) -> FocalLength:
        """The same for a picture of `factor` times as many pixels along each side."""
        return FocalLength(self.pixels * factor, self.error, self.source)


def focal_length_from_option(pixels: float) -> FocalLength:
    """What the user says.

    Raises:
        InputError: not a positive number.
    """
    if not (np.isfinite(pixels) and pixels > 0):
        raise InputError(f"a focal length of {pixels} pixels is impossible", "give a positive number of pixels")
    return FocalLength(float(pixels), OPTION_ERROR, "given")


def focal_length_from_tag(film_mm: float, size: tuple[int, int]) -> FocalLength:
    """What the video's tag says, an equivalent focal length in millimetres, for a picture of this size."""
    pixels = film_mm / FILM_DIAGONAL_MM * float(np.hypot(*size))
    return FocalLength(pixels, TAG_ERROR, f"the video's tag: {film_mm:g} mm equivalent")


def typical_focal_length(size: tuple[int, int]) -> FocalLength:
    """A guess for a picture of this size, where nothing tells."""
    pixels = TYPICAL_MM / FILM_DIAGONAL_MM * float(np.hypot(*size))
    return FocalLength(pixels, TYPICAL_ERROR, f"a guess: phones film at about {TYPICAL_MM:g} mm equivalent")


_KEY = b"com.apple.quicktime.camera.focal_length.35mm_equivalent"
_CONTAINERS = (b"trak", b"udta")
_MAX_HEADER_BYTES = 64 << 20
_PLAUSIBLE_MM = (5.0, 1000.0)
_NUMBERS = {23: ">f", 24: ">d", 65: ">b", 66: ">h", 67: ">i", 74: ">q", 75: ">B", 76: ">H", 77: ">I", 78: ">Q"}
"""Well-known types of metadata values (QuickTime File Format, "Well-known types")."""


def read_focal_length_tag(path: Path) -> float | None:
    """The 35 mm equivalent focal length in millimetres that a MOV or MP4 file tells, None where it tells none.

    Raises:
        VideoError: the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            moov = _header(file)
    except OSError as error:
        raise VideoError(f"cannot read {path}: {error.strerror}", "check the path and your permission") from error
    try:
        values = [value for value in _focal_values(moov) if _PLAUSIBLE_MM[0] <= value <= _PLAUSIBLE_MM[1]]
    except struct.error:  # a cut-off box: nothing in it is to be relied on
        return None
    return values[0] if values else None


def _header(file: BinaryIO) -> bytes:
    """The contents of the file's `moov` box, empty if it has none."""
    while len(start := file.read(8)) == 8:
        size, kind = struct.unpack(">I4s", start)
        body = size - 8
        if size == 1:
            body = int.from_bytes(file.read(8), "big") - 16
        if kind == b"moov":
            return file.read(min(body, _MAX_HEADER_BYTES) if size else _MAX_HEADER_BYTES)
        if size == 0 or body < 0:  # up to the end of the file, or damaged
            break
        file.seek(body, 1)
    return b""


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and contents of each box."""
    place = 0
    while place + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, place)
        header = 8
        if size == 1:
            size, header = struct.unpack_from(">Q", data, place + 8)[0], 16
        size = size or len(data) - place
        if size < header:
            return
        yield kind, data[place + header : place + size]
        place += size


def _focal_values(data: bytes) -> Iterator[float]:
    for kind, contents in _boxes(data):
        if kind in _CONTAINERS:
            yield from _focal_values(contents)
        elif kind == b"meta":
            # In MP4 four bytes of version and flags come first, in QuickTime not.
            parts = dict(_boxes(contents if contents[4:8] == b"hdlr" else contents[4:]))
            yield from _items(parts.get(b"keys", b""), parts.get(b"ilst", b""))


def _items(keys: bytes, values: bytes) -> Iterator[float]:
    names = [name for _, name in _boxes(keys[8:])]
    for kind, contents in _boxes(values):
        index = int.from_bytes(kind, "big") - 1
        if index < len(names) and names[index] == _KEY:
            for part, data in _boxes(contents):
                if part == b"data" and (number := _number(data)) is not None:
                    yield number


def _number(data: bytes) -> float | None:
    kind, value = int.from_bytes(data[:4], "big") & 0xFFFFFF, data[8:]
    if kind == 1:
        found = re.match(rb"\s*(\d+(?:\.\d+)?)\s*(?:mm)?\s*$", value)
        return float(found[1]) if found else None
    if kind in (21, 22):
        return float(int.from_bytes(value, "big", signed=kind == 21))
    if kind in _NUMBERS and len(value) == struct.calcsize(_NUMBERS[kind]):
        return float(struct.unpack(_NUMBERS[kind], value)[0])
    return None
