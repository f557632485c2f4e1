"""How large a picture file may be, checked by its header before memory is taken for its pixels.

No library reads the headers as strictly: what two readers could understand differently (a TIFF file that states its
size twice, data between the segments of a JPEG file) is refused here, and .hdr and .exr files are covered too.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from relit_camera.base.errors import ImageError
from relit_camera.base.images.decoder_messages import suppress_decoder_messages

MAX_IMAGE_PIXELS = 64_000_000
"""A picture of more pixels is refused: no camera or panorama in use has them, and they would fill the memory. OpenCV
has the same limit (OPENCV_IO_MAX_IMAGE_PIXELS in `relit_camera/__init__.py`)."""
MAX_JPEG_SCANS = 500
"""A progressive JPEG file has about ten. Each costs a pass over all pixels, even one of hardly any bytes."""
MAX_EXR_VALUES = 256_000_000
"""Values of all parts and channels of an OpenEXR file, which are read together: 1 GB as float32."""
MAX_HDR_LINE_BYTES = 120
"""OpenCV reads a Radiance header in pieces of 127 bytes: of a longer line it could take another size than stated."""

_JPEG_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_MARKERS_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD8)})
"""TEM and RST0 to RST7: no length follows them."""


def require_readable_size(size: Callable[[], tuple[int, int]], name: object) -> None:
    """Check that a picture file's header is sound and states at most `MAX_IMAGE_PIXELS`.

    Args:
        size: reads width and height from the header; ValueError and OSError as `image_size_from_header`.
        name: what the message calls the file.

    Raises:
        ImageError: the header is damaged, cannot be read, or states too many pixels.
    """
    try:
        width, height = size()
    except ValueError as error:
        cure = "it may be truncated; save or download it again"
        raise ImageError(f"{name} cannot be read as a picture: {error}", cure) from error
    except OSError as error:
        raise ImageError(f"cannot read {name}: {error.strerror}", "check your permission to read it") from error
    if width * height > MAX_IMAGE_PIXELS:
        what = f"{name} is {width}x{height} pixels, more than {MAX_IMAGE_PIXELS // 10**6} million"
        raise ImageError(what, "scale it down")


def image_size_from_header(path: Path) -> tuple[int, int]:
    """Width and height in pixels that the header of a picture file states, before any EXIF rotation.

    .hdr and .exr files must be what their suffix says, for their values are linear. Any other suffix stands for PNG,
    JPEG, WebP, BMP and TIFF: which of them, the content says.

    Raises:
        ValueError: the file is none of these, or its header is damaged.
        OSError: it cannot be read.
    """
    if path.suffix.lower() == ".exr":
        return _exr_size(path)
    with path.open("rb") as file:
        if path.suffix.lower() == ".hdr":
            return _radiance_size(file.read(1 << 16))
        return image_size_from_bytes(file.read())  # a JPEG's size may stand behind any amount of metadata


def image_size_from_bytes(data: bytes) -> tuple[int, int]:
    """Width and height in pixels that the bytes of a PNG, JPEG, WebP, BMP or TIFF file state.

    Raises:
        ValueError: they are none of these, or the header is damaged.
    """
    try:
        width, height = _size_by_signature(data)
    except struct.error as error:
        raise ValueError("its header is cut off") from error
    if min(width, height) < 1:
        raise ValueError(f"its header states {width}x{height} pixels")
    return width, height


def _size_by_signature(data: bytes) -> tuple[int, int]:
    if data.startswith(b"\x89PNG\r\n\x1a\n") and data[12:16] == b"IHDR":
        width, height = struct.unpack_from(">II", data, 16)
        return width, height
    if data.startswith(b"\xff\xd8"):
        return _jpeg_size(data)
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        return _webp_size(data)
    if data.startswith((b"II*\0", b"MM\0*")):
        return _tiff_size(data)
    if data.startswith(b"BM"):
        (header_bytes,) = struct.unpack_from("<I", data, 14)
        width, height = struct.unpack_from("<HH" if header_bytes == 12 else "<ii", data, 18)
        return width, abs(height)  # negative: rows from the top
    raise ValueError("none of PNG, JPEG, WebP, BMP and TIFF")


def _webp_size(data: bytes) -> tuple[int, int]:
    # RFC 9649 (container, lossless) and RFC 6386, 9.1 (lossy).
    if data[12:16] == b"VP8X":
        low, middle, high = struct.unpack_from("<HHH", data, 24)
        return 1 + low + ((middle & 0xFF) << 16), 1 + (middle >> 8) + (high << 8)
    if data[12:16] == b"VP8L":
        (bits,) = struct.unpack_from("<I", data, 21)
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    width, height = struct.unpack_from("<HH", data, 26)
    return width & 0x3FFF, height & 0x3FFF


def _tiff_size(data: bytes) -> tuple[int, int]:
    # TIFF 6.0, section 2: the entries of the first directory; 256 is the width, 257 the height, as 16 or 32 bits.
    order = "<" if data.startswith(b"II") else ">"
    (start,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, start)
    sides: dict[int, int] = {}
    for position in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind = struct.unpack_from(f"{order}HH", data, position)
        if tag not in (256, 257):
            continue
        if tag in sides or kind not in (3, 4):  # which of two counts, and what other types mean, each reader decides
            raise ValueError("a TIFF file whose size is stated twice, or not in 16 or 32 bits")
        (sides[tag],) = struct.unpack_from(f"{order}{'H' if kind == 3 else 'I'}", data, position + 8)
    if len(sides) < 2:
        raise ValueError("a TIFF file without a size")
    return sides[256], sides[257]


def _radiance_size(header: bytes) -> tuple[int, int]:
    # Radiance's file formats (radsite.lbl.gov/radiance/refer/filefmts.pdf): the resolution follows an empty line.
    found = re.match(rb"#\?.*?\n\r?\n-Y (\d{1,9}) \+X (\d{1,9})\s", header, re.DOTALL)
    if not found:
        raise ValueError("not a Radiance file with rows from the top and columns from the left")
    if any(len(line) > MAX_HDR_LINE_BYTES for line in found[0].split(b"\n")):
        raise ValueError(f"its header has a line longer than {MAX_HDR_LINE_BYTES} bytes")
    width, height = int(found[2]), int(found[1])
    if min(width, height) < 1:
        raise ValueError(f"its header states {width}x{height} pixels")
    return width, height


def _exr_size(path: Path) -> tuple[int, int]:
    import OpenEXR

    path.open("rb").close()
    try:
        with suppress_decoder_messages(), OpenEXR.File(str(path), header_only=True) as file:
            headers = [dict(part.header) for part in file.parts]  # which closing the file empties
    except Exception as error:  # OpenEXR raises RuntimeError, ValueError or KeyError
        raise ValueError("not an OpenEXR file, or its header is damaged") from error
    sizes = [_exr_part_size(header) for header in headers]
    pairs = zip(sizes, headers, strict=True)
    values = sum(width * height * len(header["channels"]) for (width, height), header in pairs)
    if values > MAX_EXR_VALUES:
        raise ValueError(f"it holds {values // 10**6} million values in all its parts and channels")
    return sizes[0]


def _exr_part_size(header: Mapping[str, Any]) -> tuple[int, int]:
    if "deep" in str(header.get("type", "")):
        raise ValueError("deep OpenEXR files have no size that could be known before they are read")
    low, high = header["dataWindow"]
    width, height = int(high[0]) - int(low[0]) + 1, int(high[1]) - int(low[1]) + 1
    if min(width, height) < 1:
        raise ValueError(f"its header states {width}x{height} pixels")
    return width, height


def _jpeg_size(data: bytes) -> tuple[int, int]:
    # ITU T.81 annex B: markers with their lengths, until the frame header.
    if data.count(b"\xff\xda") > MAX_JPEG_SCANS:  # in a picture's own bytes 0 follows each 0xFF
        raise ValueError(f"a JPEG file of more than {MAX_JPEG_SCANS} scans")
    position = 2
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker, length = data[position + 1], int.from_bytes(data[position + 2 : position + 4], "big")
        if marker in _JPEG_FRAME_MARKERS:
            height, width = struct.unpack(">HH", data[position + 5 : position + 9])
            return width, height
        if marker == 0xFF:  # a fill byte
            position += 1
        elif marker in _JPEG_MARKERS_WITHOUT_LENGTH:
            position += 2
        elif marker in (0x00, 0xD8, 0xD9) or length < 2:
            break  # no segment; decoders skip it, or give up
        else:
            position += 2 + length
    raise ValueError("a JPEG file without a frame header")
