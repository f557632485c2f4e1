"""The camera's focal length: given, from the tag that a phone writes into its video, or a typical one.

Apple's cameras write `com.apple.quicktime.camera.focal_length.35mm_equivalent` into the video track ("26", "50.00mm":
see AVMetadataIdentifier.quickTimeMetadataCameraFocalLength35mmEquivalent). No other maker is known to write one. The
boxes of the file are parsed here, since FFmpeg reports such items only where they belong to the whole file.
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
"""Diagonal of 36x24 mm film, to which equivalent focal lengths refer (CIPA DCG-001)."""
TYPICAL_MM, TYPICAL_ERROR = 31.0, 0.25
"""Equivalent focal length of a phone's video, and its relative standard error. The main camera is a 24 to 28 mm lens
for photographs; a video keeps their width but not their height, and stabilization crops a tenth: about 31 mm of what
remains, varying by a quarter between makes."""
TAG_ERROR = 0.08
"""Relative standard error of the tag, which holds for photographs and leaves out what stabilization crops."""
OPTION_ERROR = 0.02
"""Relative standard error of a focal length that the user gives."""

_KEY = b"com.apple.quicktime.camera.focal_length.35mm_equivalent"
_CONTAINERS = (b"trak", b"udta")
_MAX_HEADER_BYTES = 64 << 20
_PLAUSIBLE_MM = (5.0, 1000.0)
_NUMBERS = {23: ">f", 24: ">d", 65: ">b", 66: ">h", 67: ">i", 74: ">q", 75: ">B", 76: ">H", 77: ">I", 78: ">Q"}
"""Formats of the well-known types of metadata values (QuickTime File Format, "Well-known types")."""


@dataclass(frozen=True)
class FocalLength:
    """A camera's focal length.

    Attributes:
        pixels: in pixels of the upright picture.
        error: relative standard error.
        source: where it is from, for people.
    """

    pixels: float
    error: float
    source: str

    @property
    def log(self) -> float:
        """Natural logarithm of the focal length in pixels."""
        return float(np.log(self.pixels))

    def scaled(self, factor: float) -> FocalLength:
        """The focal length in the same picture with `factor` times as many pixels along each side."""
        return FocalLength(self.pixels * factor, self.error, self.source)


def focal_length_from_option(pixels: float) -> FocalLength:
    """A focal length in pixels that the user gives.

    Raises:
        InputError: it is not a positive number.
    """
    if not (np.isfinite(pixels) and pixels > 0):
        raise InputError(f"a focal length of {pixels} pixels is impossible", "give a positive number of pixels")
    return FocalLength(float(pixels), OPTION_ERROR, "given")


def focal_length_from_tag(film_mm: float, size: tuple[int, int]) -> FocalLength:
    """Focal length of a picture of this width and height by the 35 mm equivalent, in millimeters, of a video's tag."""
    pixels = film_mm / FILM_DIAGONAL_MM * float(np.hypot(*size))
    return FocalLength(pixels, TAG_ERROR, f"the video's tag: {film_mm:g} mm equivalent")


def typical_focal_length(size: tuple[int, int]) -> FocalLength:
    """A guess for a picture of this width and height."""
    pixels = TYPICAL_MM / FILM_DIAGONAL_MM * float(np.hypot(*size))
    return FocalLength(pixels, TYPICAL_ERROR, f"a guess: phones film at about {TYPICAL_MM:g} mm equivalent")


def known_focal_length(video: Path, size: tuple[int, int], given_px: float | None = None) -> FocalLength:
    """The best known focal length of a video: given, else by its tag, else a guess.

    Args:
        video: the file.
        size: width and height of its upright pictures.
        given_px: what the user gives, in pixels.

    Raises:
        InputError: the given one is not a positive number.
        VideoError: the file cannot be read.
    """
    if given_px is not None:
        return focal_length_from_option(given_px)
    tag_mm = read_focal_length_tag(video)
    return typical_focal_length(size) if tag_mm is None else focal_length_from_tag(tag_mm, size)


def read_focal_length_tag(path: Path) -> float | None:
    """The 35 mm equivalent focal length in millimeters from the tag of a MOV or MP4 file; None where there is none.

    Raises:
        VideoError: the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            moov = _read_moov(file)
    except OSError as error:
        raise VideoError(f"cannot read {path}: {error.strerror}", "check the path and your permission") from error
    try:
        values = [value for value in _focal_values(moov) if _PLAUSIBLE_MM[0] <= value <= _PLAUSIBLE_MM[1]]
    except struct.error:  # a truncated box: its contents are unreliable
        return None
    return values[0] if values else None


def _read_moov(file: BinaryIO) -> bytes:
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
    """Kind and contents of each box in the data."""
    start = 0
    while start + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, start)
        header = 8
        if size == 1:
            size, header = struct.unpack_from(">Q", data, start + 8)[0], 16
        size = size or len(data) - start
        if size < header:
            return
        yield kind, data[start + header : start + size]
        start += size


def _focal_values(data: bytes) -> Iterator[float]:
    """Values of the tag in the metadata of these boxes and those inside them."""
    for kind, contents in _boxes(data):
        if kind in _CONTAINERS:
            yield from _focal_values(contents)
        elif kind == b"meta":
            # MP4 has four bytes of version and flags first, QuickTime has not.
            parts = dict(_boxes(contents if contents[4:8] == b"hdlr" else contents[4:]))
            yield from _items(parts.get(b"keys", b""), parts.get(b"ilst", b""))


def _items(keys: bytes, values: bytes) -> Iterator[float]:
    """Values of the tag among metadata items, whose kind is the number of their key from 1."""
    names = [name for _, name in _boxes(keys[8:])]
    for kind, contents in _boxes(values):
        index = int.from_bytes(kind, "big") - 1
        if index < len(names) and names[index] == _KEY:
            for part, data in _boxes(contents):
                if part == b"data" and (number := _number(data)) is not None:
                    yield number


def _number(data: bytes) -> float | None:
    """The number in a metadata value (type, locale, bytes); None where it is none."""
    kind, value = int.from_bytes(data[:4], "big") & 0xFFFFFF, data[8:]
    if kind == 1:
        found = re.match(rb"\s*(\d+(?:\.\d+)?)\s*(?:mm)?\s*$", value)
        return float(found[1]) if found else None
    if kind in (21, 22):
        return float(int.from_bytes(value, "big", signed=kind == 21))
    if kind in _NUMBERS and len(value) == struct.calcsize(_NUMBERS[kind]):
        return float(struct.unpack(_NUMBERS[kind], value)[0])
    return None
