"""Picture files that mean harm: few bytes that stand for much memory or time, or lie."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np


def encoded(suffix: str, width: int = 64, height: int = 32) -> bytes:
    """A sound picture file of one grey."""
    return bytes(cv2.imencode(suffix, np.full((height, width, 3), 128, np.uint8))[1])


def deflated_zeros(count: int) -> bytes:
    """A zlib stream of so many zeros, made of one packed MiB over and over: to pack them all takes seconds."""
    whole, rest = divmod(count, 1 << 20)
    one, last = zlib.compressobj(9, wbits=-15), zlib.compressobj(9, wbits=-15)
    packed = one.compress(bytes(1 << 20)) + one.flush(zlib.Z_FULL_FLUSH)
    checksum = struct.pack(">I", (count % 65521) << 16 | 1)
    return b"\x78\xda" + packed * whole + last.compress(bytes(rest)) + last.flush() + checksum


def png_bomb(width: int = 20_000, height: int = 10_000) -> bytes:
    """A whole PNG file: 600 MB of zeros, which are 0.6 MB here."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", deflated_zeros(height * (1 + 3 * width))) + chunk(b"IEND", b"")


def png_of_size(width: int, height: int) -> bytes:
    """A small PNG file whose header states another size."""
    sound = encoded(".png")
    head = b"IHDR" + struct.pack(">II", width, height) + sound[24:29]
    return sound[:12] + head + struct.pack(">I", zlib.crc32(head)) + sound[33:]


def jpeg_of_size(width: int, height: int) -> bytes:
    """A small JPEG file whose frame header states another size."""
    sound = bytearray(encoded(".jpg"))
    at = sound.index(b"\xff\xc0")
    sound[at + 5 : at + 9] = struct.pack(">HH", height, width)
    return bytes(sound)


def jpeg_of_scans(count: int) -> bytes:
    """A progressive JPEG file that repeats its last scan: each costs a pass over all pixels."""
    sound = bytes(cv2.imencode(".jpg", np.full((1000, 2000, 3), 128, np.uint8), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1])
    last = sound.rindex(b"\xff\xda")
    return sound[:last] + sound[last:-2] * count + sound[-2:]


def webp_of_size(width: int, height: int) -> bytes:
    """A WebP file whose canvas is of another size than its picture."""
    picture = encoded(".webp")[12:]
    canvas = (
        b"VP8X" + struct.pack("<II", 10, 0) + (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    )
    body = b"WEBP" + canvas + picture
    return b"RIFF" + struct.pack("<I", len(body)) + body


def bmp_of_size(width: int, height: int) -> bytes:
    """A BMP file whose header states another size."""
    sound = bytearray(encoded(".bmp"))
    sound[18:26] = struct.pack("<ii", width, height)
    return bytes(sound)


def tiff_of_size(width: int, height: int) -> bytes:
    """A TIFF header of one directory, with nothing behind it."""
    entries = [(256, 4, width), (257, 4, height), (258, 3, 8), (259, 3, 1), (262, 3, 1), (273, 4, 8), (279, 4, 8)]
    packed = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + packed + bytes(4)


def hdr_of_size(width: int, height: int) -> bytes:
    """A Radiance header with some pixels."""
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode() + bytes(1000)


def hdr_of_two_sizes() -> bytes:
    """A Radiance file that OpenCV, which reads lines in pieces of 127 bytes, takes for a much larger one."""
    hidden = b"#" * 127 + b"\n-Y 32000 +X 32000\n"
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n" + hidden + b"\n-Y 32 +X 64\n" + bytes(1000)


def exr(width: int = 64, height: int = 32, channels: int = 3) -> bytes:
    """An OpenEXR file of half floats."""
    import OpenEXR

    planes = {f"layer{index}.R": np.ones((height, width), np.float16) for index in range(channels - 1)}
    planes["R"] = np.ones((height, width), np.float16)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, planes) as file:
            file.write(str(path))
        return path.read_bytes()


def exr_of_size(width: int, height: int, channels: int = 3) -> bytes:
    """An OpenEXR file whose data window is of another size than its pixels."""
    sound = exr(channels=channels)
    there = struct.pack("<iiii", 0, 0, 63, 31)
    return sound.replace(there, struct.pack("<iiii", 0, 0, width - 1, height - 1))


def gif(frames: int = 3) -> bytes:
    """An animated GIF file."""
    head = b"GIF89a" + struct.pack("<HHBBB", 64, 32, 0x80, 0, 0) + bytes(3) + b"\xff" * 3
    frame = b"," + struct.pack("<HHHHB", 0, 0, 64, 32, 0) + b"\x02\x02\x4c\x01\x00"
    return head + frame * frames + b";"


def animated_webp(frames: int = 300) -> bytes:
    """A WebP animation of which only the first frame is wanted."""
    animation = cv2.Animation()
    animation.frames = [np.full((32, 64, 3), index % 256, np.uint8) for index in range(frames)]
    animation.durations = [40] * frames
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.webp"
        assert cv2.imwriteanimation(str(path), animation)
        return path.read_bytes()
