"""Reading and writing picture files: the border where files' channel orders and curves end.

The size of a picture file from its header, so that an absurd one is refused before memory is taken for it.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ImageError
from relit_camera.base.images.color import Gamma, decode, uint8_from_linear
from relit_camera.base.images.decoder_messages import suppress_decoder_messages
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_camera.base.storage import atomic_path, write_atomic

LDR_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff"})
MAX_IMAGE_PIXELS = 64_000_000
"""A picture larger than this is refused: no camera or panorama in use is, and it would fill the memory."""


def read_linear(path: Path, gamma: Gamma = "srgb") -> LinearImage:
    """Read a picture as linear RGB float32 (height, width, 3); grey is repeated, alpha ignored.

    8- and 16-bit files are code values in 0..1 under `gamma`; .exr and .hdr are linear already.

    Raises:
        ImageError: missing, unreadable, too large, or not finite.
    """
    suffix = path.suffix.lower()
    if not path.is_file():
        raise ImageError(f"no picture at {path}", "check the path")
    if suffix not in LDR_SUFFIXES | {".exr", ".hdr"}:
        raise ImageError(f"{path}: '{suffix}' is not a picture format known here", "use .png, .jpg, .exr or .hdr")
    _require_size_within_limit(lambda: image_size_from_header(path), path)
    if suffix == ".exr":
        image = _read_exr(path)
    elif suffix == ".hdr":
        image = _scaled_to_unit_range(_rgb(_decoded(path.read_bytes(), path)))
    else:
        coded = _decoded(path.read_bytes(), path)
        if coded.dtype == np.uint8:  # a table: a large picture's powers would take seconds, and thrice its memory
            table = decode(np.arange(256, dtype=np.float32) / np.float32(255), gamma)
            return np.asarray(cv2.LUT(_rgb(coded), table), dtype=np.float32)
        image = decode(_scaled_to_unit_range(_rgb(coded)), gamma)
    if not np.isfinite(image).all():
        raise ImageError(f"{path} holds NaN or infinity", "render or export it again")
    return image


def read_display(path: Path) -> DisplayImage:
    """Read a picture as uint8 sRGB (height, width, 3); .exr and .hdr are clipped at 1.

    Raises:
        ImageError: as `read_linear`.
    """
    if path.suffix.lower() in LDR_SUFFIXES and path.is_file():
        return decode_display(_read_bytes(path), str(path))
    return uint8_from_linear(read_linear(path))


def decode_display(data: bytes, name: str = "the file") -> DisplayImage:
    """The bytes of a PNG, JPEG, WebP, BMP or TIFF file as uint8 sRGB (height, width, 3), upright.

    Raises:
        ImageError: they are none of these, damaged or too large; `name` says what the file is called to a person.
    """
    _require_size_within_limit(lambda: image_size_from_bytes(data), name)
    coded = _rgb(_decoded(data, name))
    if coded.dtype == np.uint8:
        return coded
    return np.rint(np.clip(_scaled_to_unit_range(coded), 0, 1) * 255).astype(np.uint8)


def read_mask(path: Path) -> Mask:
    """Read a matte as float32 (height, width) in 0..1: the alpha channel where it marks anything, else the grey value.

    Raises:
        ImageError: missing, unreadable or too large.
    """
    if not path.is_file():
        raise ImageError(f"no matte at {path}", "check the path")
    _require_size_within_limit(lambda: image_size_from_header(path), path)
    coded = _imdecode(path.read_bytes(), cv2.IMREAD_UNCHANGED)
    if coded is None:
        raise ImageError(f"{path} cannot be read as a picture", "save it again as PNG")
    scaled = _scaled_to_unit_range(coded)
    if scaled.ndim == 3:
        # Editors add an opaque alpha to grey pictures.
        has_alpha = scaled.shape[2] == 4 and bool((scaled[..., 3] < 1).any())
        scaled = scaled[..., 3] if has_alpha else scaled[..., :3].mean(axis=2)
    return np.ascontiguousarray(scaled, dtype=np.float32)


def write_linear(path: Path, image: LinearImage) -> None:
    """Write linear RGB to .npy or .exr as it is, or to .png or .jpg through the sRGB curve, clipped to 0..1.

    Raises:
        ImageError: the suffix is none of these.
        StorageError: the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix == ".npy":
        with atomic_path(path) as temporary:
            np.save(temporary, image)
    elif suffix == ".exr":
        with atomic_path(path) as temporary:
            _write_exr(temporary, image)
    else:
        write_display(path, uint8_from_linear(image))


def write_display(path: Path, image: DisplayImage) -> None:
    """Write uint8 sRGB RGB to .png or .jpg.

    Raises:
        ImageError: the suffix is neither.
        StorageError: the file cannot be written.
    """
    write_atomic(path, encode_display(image, path.suffix))


def encode_display(image: DisplayImage, suffix: str = ".jpg", quality: int = 90) -> bytes:
    """The bytes of a .png or .jpg file of uint8 sRGB RGB (height, width, 3).

    Raises:
        ImageError: the suffix is neither.
    """
    if suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise ImageError(f"cannot write pictures as '{suffix}'", "use .npy, .exr, .png or .jpg")
    options = [] if suffix.lower() == ".png" else [cv2.IMWRITE_JPEG_QUALITY, quality]
    done, data = cv2.imencode(suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR), options)
    if not done:
        raise ImageError(f"a picture of shape {image.shape} cannot be encoded as {suffix}")
    return bytes(data)


def _require_size_within_limit(size: Callable[[], tuple[int, int]], name: object) -> None:
    """Refuse by its header what is no picture, or would fill the memory."""
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


# These flags turn the picture upright as its EXIF says, which UNCHANGED does not; they drop alpha.
_UPRIGHT = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH


def _imdecode(data: bytes, flags: int = _UPRIGHT) -> NDArray | None:
    # From memory: cv2.imread knows no paths beyond the locale's encoding.
    try:
        with suppress_decoder_messages():
            return cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except (cv2.error, MemoryError):
        return None


def _decoded(data: bytes, name: object) -> NDArray:
    coded = _imdecode(data)
    if coded is None:
        raise ImageError(f"{name} cannot be read as a picture", "it may be truncated; save or download it again")
    return coded


def _rgb(coded: NDArray) -> NDArray:
    """OpenCV's channels as RGB (height, width, 3)."""
    if coded.ndim == 2:
        return np.repeat(coded[..., None], 3, axis=2)
    if coded.shape[2] == 2:
        return np.repeat(coded[..., :1], 3, axis=2)
    return np.ascontiguousarray(coded[..., 2::-1])


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ImageError(f"cannot read {path}: {error.strerror}", "check your permission to read it") from error


def _scaled_to_unit_range(coded: NDArray) -> NDArray[np.float32]:
    if coded.dtype == np.uint8:
        return coded.astype(np.float32) / np.float32(255)
    if coded.dtype == np.uint16:
        return coded.astype(np.float32) / np.float32(65535)
    return coded.astype(np.float32)


def _read_exr(path: Path) -> NDArray[np.float32]:
    import OpenEXR

    try:
        with suppress_decoder_messages(), OpenEXR.File(str(path), separate_channels=True) as file:
            planes = {name.lower(): np.asarray(c.pixels, np.float32) for name, c in file.channels().items()}
    except Exception as error:  # OpenEXR raises RuntimeError, ValueError or its own types for damaged files
        raise ImageError(f"{path} cannot be read as OpenEXR: {error}", "export it again") from error
    # Layers are named "layer.R"; the first complete set wins, the unnamed layer first.
    layers = sorted({name.rpartition(".")[0] for name in planes})
    for names in (("r", "g", "b"), ("red", "green", "blue"), ("y",), ("v",)):
        for layer in layers:
            found = [planes.get(f"{layer}.{name}" if layer else name) for name in names]
            if all(plane is not None for plane in found):
                return np.stack(found * (3 // len(found)), axis=-1)  # type: ignore[arg-type]
    raise ImageError(f"{path} has channels {', '.join(sorted(planes))}", "export it with R, G, B or Y")


def _write_exr(path: Path, image: LinearImage) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(image, dtype=np.float32)}) as file:
        file.write(str(path))


_JPEG_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_MARKERS_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD8)})
"""TEM and RST0 to RST7: no length follows them."""
MAX_JPEG_SCANS = 500
"""A progressive picture has about ten. Each costs a pass over all pixels, though it may have no bytes to speak of."""
MAX_EXR_VALUES = 256_000_000
"""Of all parts and channels, which are read together: 1 GB as float32."""
MAX_HDR_LINE_BYTES = 120
"""OpenCV reads a header in pieces of 127 bytes: a longer line may hold another size for it than for us."""


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
