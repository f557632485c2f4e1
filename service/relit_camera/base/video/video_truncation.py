"""Finds truncated video files by the sizes stated in their container, without decoding anything.

Demuxers stop at a missing end without a word where the format allows streaming; the sizes that the file itself
announces do not lie. Formats: ISO base media (ISO/IEC 14496-12), Matroska and WebM (RFC 8794, RFC 9559), RIFF, GIF89a.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

EBML_MAGIC = b"\x1a\x45\xdf\xa3"
SEGMENT_ID = b"\x18\x53\x80\x67"
MAX_BOXES = 100_000
"""At the top of an ISO file. One that was recorded in fragments has a few for each second."""
ISO_FIRST_BOXES = frozenset({b"ftyp", b"moov", b"mdat", b"free", b"wide", b"skip"})


def is_truncated(path: Path) -> bool:
    """Whether `path` is shorter than its container states. False for formats that state no sizes.

    Raises:
        ValueError: it has more than `MAX_BOXES` boxes.
    """
    length = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(12)
        file.seek(0)
        if head.startswith(EBML_MAGIC):
            return _matroska_end(file, length) > length
        if head[:4] == b"RIFF":
            announced = int.from_bytes(head[4:8], "little")
            return announced not in (0, 0xFFFFFFFF) and announced + 8 > length
        if head[:4] == b"GIF8":
            file.seek(max(0, length - 512))
            return not file.read().rstrip(b"\0").endswith(b";")
        if head[4:8] in ISO_FIRST_BOXES:
            return _iso_end(file, length) > length
    return False


def _iso_end(file: BinaryIO, length: int) -> int:
    """Find where the last top-level box should end."""
    start = 0
    for _ in range(MAX_BOXES):
        if start >= length:
            return start
        file.seek(start)
        header = file.read(16)
        size = int.from_bytes(header[:4], "big")
        if size == 0:  # up to the end of the file, however long it is
            return length
        if size == 1:
            size = int.from_bytes(header[8:16], "big")
        if size < 8:  # no box: something else follows the video
            return start
        start += size
    raise ValueError(f"it has more than {MAX_BOXES} boxes")


def _matroska_end(file: BinaryIO, length: int) -> int:
    """Find where the segment should end; 0 if it was written live and its size left open."""
    file.seek(4)
    header_size = _variable_integer(file)
    if header_size is None:
        return 0
    if header_size > length:
        return header_size
    file.seek(header_size, 1)
    if file.read(4) != SEGMENT_ID:
        return 0
    size = _variable_integer(file)
    return 0 if size is None else file.tell() + size


def _variable_integer(file: BinaryIO) -> int | None:
    """Read an EBML size: as many bytes as the first has leading zero bits, plus one. None if all ones: unknown."""
    first = file.read(1)
    if not first or first == b"\0":
        return None
    count = 9 - first[0].bit_length()
    bits = 7 * count
    value = int.from_bytes(first + file.read(count - 1), "big") & ((1 << bits) - 1)
    return None if value == (1 << bits) - 1 else value
