"""Reads and writes picture files: PNG, JPEG, WebP, BMP, TIFF, Radiance .hdr and OpenEXR.

Here the channel orders and transfer curves of files are converted: callers see RGB, either linear float32 or sRGB
uint8. What a file may hold at most is decided in `image_limits`.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ImageError
from relit_camera.base.images.color import Gamma, decode, uint8_from_linear
from relit_camera.base.images.decoder_messages import suppress_decoder_messages
from relit_camera.base.images.image_limits import (
    HDR_FORMAT,
    ImageHeader,
    image_header,
    image_header_of_file,
    radiance_header,
    require_readable_header,
)
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_camera.base.storage.atomic_files import atomic_path, write_atomic

LDR_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff"})


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
    header = require_readable_header(lambda: image_header_of_file(path), path)
    if suffix == ".exr":
        image = _read_exr(path, header)
    elif suffix == ".hdr":
        image = _rgb(_decoded(_plain_radiance(_read_bytes(path)), path, header)).astype(np.float32, copy=False)
    else:
        coded = _rgb(_decoded(_read_bytes(path), path, header))
        with np.errstate(over="ignore", invalid="ignore"):  # such values are refused below
            image = decode(coded, gamma) if coded.dtype == np.float32 else _by_table(coded, gamma)
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
        ImageError: they are none of these, damaged or too large; the message calls the file `name`.
    """
    header = require_readable_header(lambda: image_header(data), name)
    coded = _rgb(_decoded(data, name, header))
    if coded.dtype == np.uint16:
        return np.asarray(cv2.convertScaleAbs(coded, alpha=255 / 65535))
    if coded.dtype == np.uint8:
        return np.asarray(coded, np.uint8)
    if not np.isfinite(coded).all():
        raise ImageError(f"{name} holds NaN or infinity", "save it with 8 bits a channel")
    return np.asarray(np.rint(np.clip(coded, 0, 1) * 255), np.uint8)


def read_mask(path: Path) -> Mask:
    """Read a matte as float32 (height, width) in 0..1: the alpha channel unless it is opaque everywhere, else grey.

    Raises:
        ImageError: missing, unreadable or too large.
    """
    if not path.is_file():
        raise ImageError(f"no matte at {path}", "check the path")
    header = require_readable_header(lambda: image_header_of_file(path), path)
    scaled = _scaled_to_unit_range(_decoded(_read_bytes(path), path, header, cv2.IMREAD_UNCHANGED))
    if scaled.ndim == 3:
        # Picture editors add an opaque alpha channel to grey pictures: such a one is no matte.
        has_alpha = scaled.shape[2] == 4 and bool((scaled[..., 3] < 1).any())
        with np.errstate(over="ignore", invalid="ignore"):  # such values are refused below
            scaled = scaled[..., 3] if has_alpha else scaled[..., :3].mean(axis=2)
    if not np.isfinite(scaled).all():
        raise ImageError(f"{path} holds NaN or infinity", "save it with 8 bits a channel")
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


# These flags turn the picture upright as its EXIF says, which UNCHANGED does not; they drop alpha.
_UPRIGHT = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH


def _decoded(data: bytes, name: object, header: ImageHeader, flags: int = _UPRIGHT) -> NDArray:
    """OpenCV's picture of a file's bytes: (height, width) or (height, width, channels), uint8, uint16 or float32."""
    # From memory: cv2.imread knows no paths beyond the locale's encoding.
    coded = None
    try:
        with suppress_decoder_messages():
            coded = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        if error.code == cv2.Error.STS_NO_MEM:
            raise _memory_error(name) from MemoryError(str(error))
    except MemoryError as error:
        raise _memory_error(name) from error
    if coded is None or coded.dtype not in (np.uint8, np.uint16, np.float32):
        raise ImageError(f"{name} cannot be read as a picture", "it may be truncated; save or download it again")
    if coded.shape[:2] not in (header.size, header.size[::-1]):  # EXIF may turn it
        what = f"{name} states {header.width}x{header.height} pixels and holds {coded.shape[1]}x{coded.shape[0]}"
        raise ImageError(what, "save it again")
    return np.asarray(coded)


def _memory_error(name: object) -> ImageError:
    """What is to be raised from a MemoryError: whoever limits the memory knows by it whether the file is at fault."""
    return ImageError(f"{name} takes more memory than there is to be decoded", "close other programs, or scale it down")


def _by_table(coded: NDArray, gamma: Gamma) -> LinearImage:
    """Codes of 8 or 16 bits as linear light: computed for each pixel it would take seconds and thrice the memory."""
    white = int(np.iinfo(coded.dtype).max)
    table = decode(np.arange(white + 1, dtype=np.float32) / np.float32(white), gamma)
    if coded.dtype == np.uint8:
        return np.asarray(cv2.LUT(coded, table), dtype=np.float32)
    image = np.empty(coded.shape, np.float32)
    for codes, row in zip(coded, image, strict=True):  # NumPy makes indices of 64 bits of what it looks up at once
        row[:] = table[codes]
    return image


def _plain_radiance(data: bytes) -> bytes:
    """A Radiance file with a header that holds its size and nothing else: readers differ in what they skip."""
    header, start = radiance_header(data)
    return b"#?RADIANCE\n" + HDR_FORMAT + f"\n\n-Y {header.height} +X {header.width}\n".encode() + data[start:]


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


def _read_exr(path: Path, header: ImageHeader) -> NDArray[np.float32]:
    import OpenEXR

    try:
        with suppress_decoder_messages(), OpenEXR.File(str(path), separate_channels=True) as file:
            planes = {name.lower(): channel.pixels for name, channel in file.channels().items()}
    except Exception as error:  # OpenEXR raises RuntimeError, ValueError or its own types for damaged files
        raise ImageError(f"{path} cannot be read as OpenEXR: {error}", "export it again") from error
    # Layers are named "layer.R"; the first complete set wins, the unnamed layer first.
    layers = sorted({name.rpartition(".")[0] for name in planes})
    for names in (("r", "g", "b"), ("red", "green", "blue"), ("y",), ("v",)):
        for layer in layers:
            wanted = [f"{layer}.{name}" if layer else name for name in names]
            if not set(wanted) <= planes.keys():
                continue
            found = [planes[name] for name in wanted]
            if any(plane.shape != header.size[::-1] for plane in found):
                raise ImageError(f"{path} has channels of several sizes", "export it without subsampling")
            image = np.empty((header.height, header.width, 3), np.float32)
            for channel in range(3):
                image[..., channel] = found[channel % len(found)]
            return image
    listed = ", ".join(name if name.isprintable() else repr(name) for name in sorted(planes))
    raise ImageError(f"{path} has channels {listed[:200]}", "export it with R, G, B or Y")


def _write_exr(path: Path, image: LinearImage) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(image, dtype=np.float32)}) as file:
        file.write(str(path))
