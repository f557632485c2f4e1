"""The size of a picture file from its header, so that an absurd one is refused before memory is taken for it."""

from __future__ import annotations

import re
import struct
from pathlib import Path

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_JPEG_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels that the header of a .hdr, .exr, .png or .jpg file states.

    Raises:
        ValueError: the file is not what its suffix says, or its header is damaged.
        OSError: it cannot be read.
    """
    if path.suffix.lower() == ".exr":
        return _exr_size(path)
    with path.open("rb") as file:
        if path.suffix.lower() == ".hdr":
            return _radiance_size(file.read(1 << 16))
        data = file.read()  # a JPEG's size may stand behind any amount of metadata
    if data.startswith(_PNG) and data[12:16] == b"IHDR" and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return width, height
    if data.startswith(_JPEG):
        return _jpeg_size(data)
    raise ValueError("neither a PNG nor a JPEG file")


def _radiance_size(header: bytes) -> tuple[int, int]:
    # Radiance's file formats (radsite.lbl.gov/radiance/refer/filefmts.pdf): the resolution follows an empty line.
    found = re.match(rb"#\?.*?\n\r?\n-Y (\d{1,9}) \+X (\d{1,9})\s", header, re.DOTALL)
    if not found:
        raise ValueError("not a Radiance file with rows from the top and columns from the left")
    return int(found[2]), int(found[1])


def _exr_size(path: Path) -> tuple[int, int]:
    import OpenEXR

    path.open("rb").close()
    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            low, high = file.header()["dataWindow"]
    except Exception as error:  # OpenEXR raises RuntimeError, ValueError or KeyError
        raise ValueError("not an OpenEXR file, or its header is damaged") from error
    return int(high[0]) - int(low[0]) + 1, int(high[1]) - int(low[1]) + 1


def _jpeg_size(data: bytes) -> tuple[int, int]:
    # ITU T.81 annex B: markers with their lengths, until the frame header.
    position = 2
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker, length = data[position + 1], int.from_bytes(data[position + 2 : position + 4], "big")
        if marker in _JPEG_FRAME_MARKERS:
            height, width = struct.unpack(">HH", data[position + 5 : position + 9])
            return width, height
        position += 1 if marker == 0xFF else 2 + length
    raise ValueError("a JPEG file without a frame header")
