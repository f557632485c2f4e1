"""How large a picture file may be, checked by its header before memory is taken for its pixels.

No library reads the headers as strictly: what two readers could understand differently (a TIFF file that states its
size twice, data between the segments of a JPEG file) is refused here, and .hdr and .exr files are covered too. Every
length that a file states is compared with the file's own: decoders take the memory first and look then.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relit_camera.base.errors import ImageError
from relit_camera.base.images.decoder_messages import suppress_decoder_messages

MAX_IMAGE_PIXELS = 64_000_000
"""A picture of more pixels is refused: no camera or panorama in use has them, and they would fill the memory. OpenCV
has the same limit (OPENCV_IO_MAX_IMAGE_PIXELS in `relit_camera/__init__.py`)."""
MAX_DECODED_BYTES = 370_000_000
"""Of the pixels of a PNG, JPEG, WebP, BMP or TIFF file, as they are decoded. With 16 bits a channel a camera's
picture of 61 million pixels takes 361 MB, and the largest panorama with alpha 268 MB."""
MAX_FILE_BYTES = 640 << 20
"""Of a picture file: more than the largest panorama of four channels without compression, 512 MiB and a header."""
MAX_PNG_CHUNKS = 100_000
"""A file of 64 million pixels in chunks of 8 KiB has a quarter of that."""
MAX_JPEG_SCANS = 500
"""A progressive JPEG file has about ten. Each costs a pass over all pixels, even one of hardly any bytes."""
MAX_EXR_VALUES = 256_000_000
"""Values of all parts and channels of an OpenEXR file, which are read together: 1 GB as float32."""
MAX_EXR_HEADER_BYTES = 1 << 20
"""Of all parts together. Programs write some kilobytes; a preview picture may take some hundred."""
MAX_EXR_TILE_SIDE = 8192
MAX_HDR_LINE_BYTES = 120
"""OpenCV reads a Radiance header in pieces of 127 bytes: of a longer line it could take another size than stated."""
MAX_HDR_HEADER_BYTES = 1 << 16
HDR_FORMAT = b"FORMAT=32-bit_rle_rgbe"

_JPEG_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_MARKERS_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD8)})
"""TEM and RST0 to RST7: no length follows them."""
_PNG_CHANNELS = {0: 1, 2: 3, 3: 4, 4: 2, 6: 4}
"""By color type; a palette's colors may have alpha."""


@dataclass(frozen=True)
class ImageHeader:
    """What a picture file's header states.

    Attributes:
        width, height: in pixels, before any EXIF rotation.
        pixel_bytes: of a pixel as it is decoded, at most; 0 for .hdr and .exr, whose pixels are always floats.
    """

    width: int
    height: int
    pixel_bytes: int = 0

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width, self.height


def require_readable_header(header: Callable[[], ImageHeader], name: object) -> ImageHeader:
    """Give a picture file's header if it is sound and states no more than can be read.

    Args:
        header: reads it; ValueError and OSError as `image_header_of_file`.
        name: what the message calls the file.

    Raises:
        ImageError: the header is damaged, cannot be read, or states too many pixels or bytes of them.
    """
    try:
        found = header()
    except ValueError as error:
        cure = "it may be truncated; save or download it again"
        raise ImageError(f"{name} cannot be read as a picture: {error}", cure) from error
    except OSError as error:
        raise ImageError(f"cannot read {name}: {error.strerror}", "check your permission to read it") from error
    pixels = found.width * found.height
    size = f"{name} is {found.width}x{found.height} pixels"
    if pixels > MAX_IMAGE_PIXELS:
        raise ImageError(f"{size}, more than {MAX_IMAGE_PIXELS // 10**6} million", "scale it down")
    if pixels * found.pixel_bytes > MAX_DECODED_BYTES:
        what = f"{size} of {found.pixel_bytes} bytes, more than {MAX_DECODED_BYTES // 10**6} MB"
        raise ImageError(what, "save it with 8 bits a channel, or scale it down")
    return found


def image_header_of_file(path: Path) -> ImageHeader:
    """What the header of a picture file states.

    .hdr and .exr files must be what their suffix says, for their values are linear. Any other suffix stands for PNG,
    JPEG, WebP, BMP and TIFF: which of them, the content says.

    Raises:
        ValueError: the file is none of these, larger than `MAX_FILE_BYTES`, or its header is damaged.
        OSError: it cannot be read.
    """
    if path.stat().st_size > MAX_FILE_BYTES:
        raise ValueError(f"it is larger than {MAX_FILE_BYTES >> 20} MiB")
    if path.suffix.lower() == ".exr":
        return ImageHeader(*_exr_size(path))
    with path.open("rb") as file:
        if path.suffix.lower() == ".hdr":
            return radiance_header(file.read(MAX_HDR_HEADER_BYTES))[0]
        return image_header(file.read())  # a JPEG's size may stand behind any amount of metadata


def image_header(data: bytes) -> ImageHeader:
    """What the header of a PNG, JPEG, WebP, BMP or TIFF file states, given the file's bytes.

    Raises:
        ValueError: they are none of these, or the header is damaged.
    """
    try:
        found = _header_by_signature(data)
    except struct.error as error:
        raise ValueError("its header is cut off") from error
    if min(found.size) < 1:
        raise ValueError(f"its header states {found.width}x{found.height} pixels")
    return found


def _header_by_signature(data: bytes) -> ImageHeader:
    if data.startswith(b"\x89PNG\r\n\x1a\n") and data[12:16] == b"IHDR":
        return _png_header(data)
    if data.startswith(b"\xff\xd8"):
        return ImageHeader(*_jpeg_size(data), 3)
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        return ImageHeader(*_webp_size(data), 4)
    if data.startswith((b"II*\0", b"MM\0*")):
        return _tiff_header(data)
    if data.startswith(b"BM"):
        (header_bytes,) = struct.unpack_from("<I", data, 14)
        width, height = struct.unpack_from("<HH" if header_bytes == 12 else "<ii", data, 18)
        return ImageHeader(width, abs(height), 4)  # negative: rows from the top
    raise ValueError("none of PNG, JPEG, WebP, BMP and TIFF")


def _png_header(data: bytes) -> ImageHeader:
    # PNG (third edition), 5.3: chunks of a length, a type, that many bytes, and a checksum.
    width, height, bits, color_type = struct.unpack_from(">IIBB", data, 16)
    header = ImageHeader(width, height, _PNG_CHANNELS.get(color_type, 4) * (2 if bits == 16 else 1))
    if width * height > MAX_IMAGE_PIXELS:
        return header  # which says more than that the file is cut off
    position, count, kind = 8, 0, b""
    while position < len(data) and kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", data, position)
        position, count = position + 12 + length, count + 1
        if position > len(data):
            raise ValueError("a chunk of it ends beyond the file")
        if count > MAX_PNG_CHUNKS:
            raise ValueError(f"a PNG file of more than {MAX_PNG_CHUNKS} chunks")
    return header


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


def _tiff_header(data: bytes) -> ImageHeader:
    # TIFF 6.0, section 2: the entries of the first directory; 256 is the width, 257 the height, 258 bits of a sample,
    # 277 samples of a pixel, 322 and 323 the sides of a tile.
    order = "<" if data.startswith(b"II") else ">"
    (start,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, start)
    found: dict[int, int] = {}
    for position in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind, values = struct.unpack_from(f"{order}HHI", data, position)
        if tag not in (256, 257, 258, 277, 322, 323):
            continue
        if tag in found or kind not in (3, 4):  # which of two counts, and what other types mean, each reader decides
            raise ValueError("a TIFF file whose size is stated twice, or not in 16 or 32 bits")
        if values * (2 if kind == 3 else 4) > 4:  # they stand elsewhere: bits of several samples
            (position,) = struct.unpack_from(f"{order}I", data, position + 8)
            position -= 8
        (found[tag],) = struct.unpack_from(f"{order}{'H' if kind == 3 else 'I'}", data, position + 8)
    if not {256, 257} <= found.keys():
        raise ValueError("a TIFF file without a size")
    pixel_bytes = max(found.get(277, 1), 3) * -(-found.get(258, 1) // 8)
    if found.get(322, 0) * found.get(323, 0) * pixel_bytes > MAX_DECODED_BYTES:
        raise ValueError("a TIFF file of tiles that are too large")
    return ImageHeader(found[256], found[257], pixel_bytes)


def radiance_header(data: bytes) -> tuple[ImageHeader, int]:
    """What the header of a Radiance file states, given the beginning of the file, and where its pixels begin.

    Raises:
        ValueError: it is no such file, or its header is damaged or too long.
    """
    # Radiance's file formats (radsite.lbl.gov/radiance/refer/filefmts.pdf): lines up to an empty one, then the size.
    empty = re.search(rb"\n\r?\n", data)
    if not data.startswith(b"#?") or empty is None:
        raise ValueError("not a Radiance file")
    lines = [line.rstrip(b"\r") for line in data[: empty.start()].split(b"\n")]
    if any(len(line) > MAX_HDR_LINE_BYTES for line in lines):
        raise ValueError(f"its header has a line longer than {MAX_HDR_LINE_BYTES} bytes")
    found = re.compile(rb"-Y (\d{1,9}) \+X (\d{1,9})\r?\n").match(data, empty.end())
    if found is None:
        raise ValueError("not a Radiance file with rows from the top and columns from the left")
    if HDR_FORMAT not in lines:
        raise ValueError("not a Radiance file of red, green, blue and exponent")
    width, height = int(found[2]), int(found[1])
    if min(width, height) < 1:
        raise ValueError(f"its header states {width}x{height} pixels")
    return ImageHeader(width, height), found.end()


def _exr_size(path: Path) -> tuple[int, int]:
    import OpenEXR

    with path.open("rb") as file:
        try:
            _require_sound_exr_attributes(file.read(MAX_EXR_HEADER_BYTES), path.stat().st_size)
        except (struct.error, IndexError) as error:
            raise ValueError(f"its header is cut off, or longer than {MAX_EXR_HEADER_BYTES >> 20} MiB") from error
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


def _require_sound_exr_attributes(data: bytes, file_bytes: int) -> None:
    """Check the lengths in an OpenEXR file's header, given its beginning: the library takes memory by them.

    Raises:
        ValueError: it is no such file, or they are wrong.
        struct.error, IndexError: it is cut off.
    """
    # openexr.com/en/latest/OpenEXRFileLayout.html: attributes of name, type, length and value, up to an empty name;
    # of a file of several parts each has a header, up to an empty one.
    magic, version = struct.unpack_from("<II", data)
    if magic != 20000630:
        raise ValueError("not an OpenEXR file")
    position, of_parts = 8, bool(version & 0x1000)
    while data[position]:
        while data[position]:
            name_end = data.index(b"\0", position)
            kind_end = data.index(b"\0", name_end + 1)
            (length,) = struct.unpack_from("<I", data, kind_end + 1)
            value = kind_end + 5
            if value + length > file_bytes:
                raise ValueError("an attribute in its header ends beyond the file")
            is_tile = data[name_end + 1 : kind_end] == b"tiledesc"
            if is_tile and max(struct.unpack_from("<II", data, value)) > MAX_EXR_TILE_SIDE:
                raise ValueError(f"an OpenEXR file of tiles of more than {MAX_EXR_TILE_SIDE} pixels a side")
            position = value + length
        position += 1
        if not of_parts:
            return


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
