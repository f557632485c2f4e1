"""The focal length that a phone writes into its video.

Apple's cameras write `com.apple.quicktime.camera.focal_length.35mm_equivalent` into the video track ("26", "50.00mm":
see AVMetadataIdentifier.quickTimeMetadataCameraFocalLength35mmEquivalent); FFmpeg reports such items only where they
belong to the whole file. No other maker is known to write one.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from relit_camera.errors import VideoError

_KEY = b"com.apple.quicktime.camera.focal_length.35mm_equivalent"
_CONTAINERS = (b"trak", b"udta")
_MAX_HEADER_BYTES = 64 << 20
_PLAUSIBLE_MM = (5.0, 1000.0)
_NUMBERS = {23: ">f", 24: ">d", 65: ">b", 66: ">h", 67: ">i", 74: ">q", 75: ">B", 76: ">H", 77: ">I", 78: ">Q"}
"""Well-known types of metadata values (QuickTime File Format, "Well-known types")."""


def read_focal_tag(path: Path) -> float | None:
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
