"""The files that once took gigabytes, minutes, or ended in an error that nobody caught: each is built anew.

They are small programs, not stored files: most unpack to hundreds of megabytes.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np

from tests.bad_pictures import deflated_zeros, encoded

MIB = 1 << 20


@dataclass(frozen=True)
class LyingFile:
    """A file, and which readers it was made for.

    Attributes:
        kind: a key of `readers.READERS`.
        suffix: of its name.
        make: builds its content.
        is_large: whether that takes seconds, or is megabytes.
    """

    kind: str
    suffix: str
    make: Callable[[], bytes]
    is_large: bool = False


def png_chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_of_zeros(width: int, height: int, bits: int = 8, color_type: int = 2) -> bytes:
    """A whole PNG file of black."""
    channels = {0: 1, 2: 3, 6: 4}[color_type]
    head = png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, color_type, 0, 0, 0))
    rows = deflated_zeros(height * (1 + width * channels * bits // 8))
    return b"\x89PNG\r\n\x1a\n" + head + png_chunk(b"IDAT", rows) + png_chunk(b"IEND", b"")


def png_of_a_long_chunk() -> bytes:
    """45 bytes: a header and a chunk that states 4.3 GB."""
    head = png_chunk(b"IHDR", struct.pack(">IIBBBBB", 64, 32, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + struct.pack(">I", 0xFFFFFFF0) + b"IDAT" + bytes(4)


def png_of_a_long_end() -> bytes:
    """A sound file whose last chunk, which holds nothing, states 960 MB."""
    return encoded(".png")[:-12] + struct.pack(">I", 960_051_456) + b"IEND" + bytes(4)


def png_of_a_text_bomb() -> bytes:
    """A comment that is 60 kB, and 60 MB when it is unpacked."""
    sound = encoded(".png")
    packed = png_chunk(b"zTXt", b"Comment\0\0" + zlib.compress(bytes(60 * MIB), 9))
    return sound[:33] + packed + sound[33:]


def apng(frames: int, width: int, height: int) -> bytes:
    """An animated PNG: each frame is a full picture of zeros."""
    rows = deflated_zeros(height * (1 + width * 3))
    parts = [png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))]
    parts.append(png_chunk(b"acTL", struct.pack(">II", frames, 0)))
    for index in range(frames):
        control = struct.pack(">IIIIIHHBB", 2 * index, width, height, 0, 0, 1, 10, 0, 0)
        parts.append(png_chunk(b"fcTL", control))
        sequence = struct.pack(">I", 2 * index + 1)
        parts.append(png_chunk(b"IDAT", rows) if index == 0 else png_chunk(b"fdAT", sequence + rows))
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts) + png_chunk(b"IEND", b"")


def hdr_of_a_decoy_size() -> bytes:
    """A Radiance file of 62.7 million pixels, whose size has two spaces; a smaller one is among its pixels."""
    width, height, decoy = 11200, 5600, b"\n\n-Y 32 +X 64\n"

    def run(count: int) -> bytes:
        return b"\xff\0" * (count // 127) + (bytes([128 + count % 127, 0]) if count % 127 else b"")

    start = b"\2\2" + struct.pack(">H", width)
    first = start + bytes([len(decoy)]) + decoy + run(width - len(decoy)) + run(width) * 3
    return (
        f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y  {height} +X {width}\n".encode()
        + first
        + (start + run(width) * 4) * (height - 1)
    )


def tiff_of_directories(entries: list[tuple[int, int, int, int]], rest: bytes = b"") -> bytes:
    """A TIFF file of one directory; entries are tag, type, count, value."""
    packed = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + packed + bytes(4) + rest


def tiff_of_a_large_tile() -> bytes:
    """A picture of 64x32 pixels whose one tile states 2^31 bytes."""
    sides = [(256, 4, 1, 64), (257, 4, 1, 32), (258, 3, 1, 8), (259, 3, 1, 8), (262, 3, 1, 1), (277, 3, 1, 1)]
    tile = [(322, 4, 1, 46336), (323, 4, 1, 46336), (324, 4, 1, 200), (325, 4, 1, 60)]
    return tiff_of_directories(sides + tile, zlib.compress(bytes(20000), 9))


def tiff_of_many_values() -> bytes:
    """A directory entry that states 2^32 - 1 strips."""
    sides = [(256, 4, 1, 64), (257, 4, 1, 32), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1)]
    return tiff_of_directories([*sides, (273, 4, 0xFFFFFFFF, 8), (278, 4, 1, 32), (279, 4, 0xFFFFFFFF, 8)])


def tiff_of_floats() -> bytes:
    """A picture of fractions, some of which are none."""
    picture = np.ones((8, 16, 3), np.float32)
    picture[0, :3, 0] = np.nan, np.inf, 3e38
    return bytes(cv2.imencode(".tif", picture)[1])


def exr_of_channels(sampling: Mapping[str, tuple[int, int]], width: int = 64, height: int = 32) -> bytes:
    """An uncompressed OpenEXR file of half floats whose channels are sampled every so many pixels."""

    def attribute(name: str, kind: str, value: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(value)) + value

    channels = b"".join(
        name.encode() + b"\0" + struct.pack("<IIII", 1, 0, *sampling[name]) for name in sorted(sampling)
    )
    window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    header = struct.pack("<II", 20000630, 2) + b"".join(
        (
            attribute("channels", "chlist", channels + b"\0"),
            attribute("compression", "compression", b"\0"),
            attribute("dataWindow", "box2i", window),
            attribute("displayWindow", "box2i", window),
            attribute("lineOrder", "lineOrder", b"\0"),
            attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
            attribute("screenWindowCenter", "v2f", bytes(8)),
            attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
        )
    )
    header += b"\0"
    lines = []
    for y in range(height):
        values = b"".join(
            struct.pack("<e", 1.0) * (width // across)
            for _, (across, down) in sorted(sampling.items())
            if y % down == 0
        )
        lines.append(struct.pack("<iI", y, len(values)) + values)
    place, table = len(header) + 8 * height, []
    for line in lines:
        table.append(struct.pack("<Q", place))
        place += len(line)
    return header + b"".join(table) + b"".join(lines)


def gif_of_size(width: int, height: int, frames: int = 1) -> bytes:
    """A GIF file of one colour: of LZW codes each stands for one more pixel than the one before it."""
    head = b"GIF89a" + struct.pack("<HHBBB", width, height, 0x80, 0, 0) + bytes(3) + b"\xff" * 3
    bits, held, size, table, out = 0, 0, 3, 6, bytearray()

    def put(code: int) -> None:
        nonlocal bits, held
        bits |= code << held
        held += size
        while held >= 8:
            out.append(bits & 255)
            bits >>= 8
            held -= 8

    put(4)
    left, run, code = width * height, 1, 0
    while left > 0:
        put(code)
        left -= run
        code, run = (table if table < 4096 else 0), run + 1
        if run > 2:
            table += 1
        if table > (1 << size) - 0 and size < 12:
            size += 1
        if table >= 4095:
            put(4)
            size, table, run, code = 3, 6, 1, 0
    put(5)
    if held:
        out.append(bits & 255)
    blocks = b"".join(bytes([len(out[i : i + 255])]) + out[i : i + 255] for i in range(0, len(out), 255))
    frame = b"," + struct.pack("<HHHHB", 0, 0, width, height, 0) + b"\x02" + blocks + b"\0"
    return head + frame * frames + b";"


# Subjects


def safetensors(header: Mapping[str, Any] | bytes, content: bytes = b"") -> bytes:
    """A safetensors file of this header, sound or not."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + content


def subject_metadata(**changed: object) -> dict[str, str]:
    """The header of a subject of 8x8 pixels, under its key."""
    sound = {
        "format_version": 2, "width": 8, "height": 8, "method": "blend", "lights": 1, "components": 1, "source": "a",
        "psnr_db": 30.0, "created_by": "a", "created_at": "b",
    }  # fmt: skip
    return {"relit_subject": json.dumps(sound | changed)}


SUBJECT_TENSORS: dict[str, tuple[str, list[int]]] = {
    "coefficients": ("F32", [1, 2048]),
    "light_directions": ("F32", [1, 3]),
    "light_coefficients": ("F32", [1, 1]),
    "matte": ("F32", [8, 8]),
    "neutral": ("U8", [8, 8, 3]),
    "basis.pixels": ("I32", [1, 64]),
    "basis.first": ("I32", [2]),
    "basis.values": ("I8", [1, 3, 64]),
    "basis.scales": ("F32", [1]),
    "basis.mixes": ("F16", [1, 1]),
}
BYTES_OF_KIND = {"F16": 2, "F32": 4, "U8": 1, "I8": 1, "I32": 4, "F64": 8, "I64": 8, "BOOL": 1}


def subject(tensors: Mapping[str, tuple[str, list[int]]] | None = None, **changed: object) -> bytes:
    """A subject of 8x8 pixels, with some of its tensors replaced by zeros of another type and shape."""
    header: dict[str, Any] = {"__metadata__": subject_metadata(**changed)}
    content = b""
    for name, (kind, shape) in (SUBJECT_TENSORS | dict(tensors or {})).items():
        count = 1
        for side in shape:
            count *= side
        data = bytes(count * BYTES_OF_KIND[kind])
        if name == "basis.first" and shape == [2]:
            data = struct.pack("<ii", 0, 1)
        header[name] = {"dtype": kind, "shape": shape, "data_offsets": [len(content), len(content) + len(data)]}
        content += data
    return safetensors(header, content)


def subject_of_much_metadata(size: int = 95 * MIB) -> bytes:
    """A sound subject with millions of further keys in its header."""
    sound = subject()
    length = int.from_bytes(sound[:8], "little")
    keys = b",".join(b'"%x":""' % index for index in range(size // 13))
    header = sound[8 : 8 + length].replace(b'"__metadata__": {', b'"__metadata__": {' + keys + b",", 1)
    return safetensors(header, sound[8 + length :])


def subject_with_still(webp: bytes, landmarks: tuple[float, float] = (8.0, 16.0)) -> bytes:
    """A sound subject with one expression still, its landmarks at two places by turns, the eyes' corners apart."""
    points = np.full((1, 478, 2), landmarks[0], np.float32)
    points[:, 200:] = landmarks[1]
    tensors: dict[str, np.ndarray] = {
        "stills.webp": np.frombuffer(webp, np.uint8),
        "stills.landmarks": points,
        "stills.expressions": np.zeros((1, 478, 3), np.float32),
        "stills.rotations": np.zeros((1, 3), np.float32),
        "stills.lights": np.zeros((1, 32, 64, 3), np.float16),
    }
    kinds = {"uint8": "U8", "float32": "F32", "float16": "F16"}
    sound = subject()
    length = int.from_bytes(sound[:8], "little")
    header, content = json.loads(sound[8 : 8 + length]), sound[8 + length :]
    for name, values in tensors.items():
        place = [len(content), len(content) + values.nbytes]
        header[name] = {"dtype": kinds[values.dtype.name], "shape": list(values.shape), "data_offsets": place}
        content += values.tobytes()
    return safetensors(header, content)


def webp_of_side(side: int) -> bytes:
    """A square WebP picture."""
    return bytes(cv2.imencode(".webp", np.zeros((side, side, 3), np.uint8))[1])


# Mattes


def zipped(name: str, content: bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip file of one member."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", method) as file:
        file.writestr(name, content)
    return packed.getvalue()


def npy(header: str, content: bytes = b"") -> bytes:
    """An .npy file of version 1 whose header is any text."""
    text = header.encode("latin-1")
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + content


def matte_of_a_long_header(size: int = 3_900_000_000) -> bytes:
    """A zip file whose array has a header of 3.9 GB of spaces, which are 3.8 MB here; its checksum is not made."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    block = 16 * MIB
    start = packer.compress(b"\x93NUMPY\x02\x00" + struct.pack("<I", size)) + packer.flush(zlib.Z_FULL_FLUSH)
    again = packer.compress(b" " * block) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = start + again * (size // block) + packer.flush()
    name, sizes = b"alpha.npy", struct.pack("<III", 0, len(packed), 12 + size // block * block)
    common = struct.pack("<HHHHH", 20, 0, 8, 0, 0) + sizes + struct.pack("<HH", len(name), 0)
    local = b"PK\3\4" + common + name + packed
    directory = b"PK\1\2" + struct.pack("<H", 20) + common + struct.pack("<HHHII", 0, 0, 0, 0, 0) + name
    return local + directory + b"PK\5\6" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(directory), len(local), 0)


def matte(header: str, content: bytes = b"") -> bytes:
    """A recorded matte whose array has any header."""
    return zipped("alpha.npy", npy(header, content))


def sound_matte() -> bytes:
    """A recorded matte of two frames."""
    return matte("{'descr': '|u1', 'fortran_order': False, 'shape': (2, 8, 8), }", bytes(128))


def matte_by_lzma() -> bytes:
    """A matte packed by LZMA, whose stream is broken."""
    sound = zipped("alpha.npy", npy("{'descr': '|u1', 'fortran_order': False, 'shape': (2, 8, 8), }", bytes(128)),
                   zipfile.ZIP_LZMA)  # fmt: skip
    at = sound.index(b"alpha.npy") + 9
    return sound[: at + 12] + bytes(byte ^ 0xFF for byte in sound[at + 12 : at + 40]) + sound[at + 40 :]


def matte_encrypted() -> bytes:
    """A matte whose member is said to be encrypted."""
    data = bytearray(sound_matte())
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        data[data.index(signature) + offset] |= 1
    return bytes(data)


def matte_of_a_zip_version() -> bytes:
    """A matte whose member needs version 25.5 of the zip format."""
    data = bytearray(sound_matte())
    data[data.index(b"PK\1\2") + 6] = 255
    return bytes(data)


def zip_of_many_members(count: int = 300_000) -> bytes:
    """A zip file whose directory lists a member 300,000 times."""
    sound = sound_matte()
    directory, end = sound.index(b"PK\1\2"), sound.index(b"PK\5\6")
    entry = sound[directory:end]
    extended = struct.pack("<4sQHHIIQQQQ", b"PK\6\6", 44, 45, 45, 0, 0, count, count, count * len(entry), directory)
    locator = struct.pack("<4sIQI", b"PK\6\7", 0, directory + count * len(entry), 1)
    last = struct.pack("<4sHHHHIIH", b"PK\5\6", 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF, 0)
    return sound[:directory] + entry * count + extended + locator + last


# Videos


def sound_video(suffix: str, title: bytes = b"") -> bytes:
    """Three frames of 32x16 pixels."""
    import av

    with TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        with av.open(str(path), "w") as file:
            if title:
                file.metadata["title"] = "TITLE" * 4
            codec = "mjpeg" if suffix == ".avi" else "mpeg4"
            stream = file.add_stream(codec, rate=25)
            stream.width, stream.height = 32, 16
            stream.pix_fmt = "yuvj420p" if suffix == ".avi" else "yuv420p"
            for index in range(3):
                picture = av.VideoFrame.from_ndarray(np.full((16, 32, 3), 80 * index, np.uint8), format="rgb24")
                file.mux(stream.encode(picture.reformat(format=stream.pix_fmt)))
            file.mux(stream.encode())
        data = path.read_bytes()
    return data.replace(b"TITLE" * 4, title.ljust(20, b"x")) if title else data


def matroska_of_a_far_end() -> bytes:
    """A Matroska file whose header states nearly 2^56 bytes."""
    return b"\x1a\x45\xdf\xa3" + b"\x01" + (2**56 - 2).to_bytes(7, "big") + bytes(100)


def mp4_of_boxes(count: int = 4_000_000) -> bytes:
    """An ISO file of nothing but empty boxes."""
    return struct.pack(">I4s", 16, b"ftyp") + b"isom\0\0\0\0" + struct.pack(">I4s", 8, b"free") * count


# YAML


def flow_list(size: int = MIB - 100) -> bytes:
    """A list of a million nothings on one line."""
    return b"a: [" + b",".join([b"1"] * (size // 2)) + b"]\n"


FINDS: dict[str, LyingFile] = {
    "png of a 4 GB chunk, 45 bytes": LyingFile("picture", ".png", png_of_a_long_chunk),
    "png of a 960 MB end": LyingFile("picture", ".png", png_of_a_long_end),
    "png, 64 Mpx of 16 bits": LyingFile("picture", ".png", lambda: png_of_zeros(8000, 8000, 16), is_large=True),
    "png, 64 Mpx of 16 bits, alpha": LyingFile(
        "picture", ".png", lambda: png_of_zeros(8000, 8000, 16, 6), is_large=True
    ),
    "png with a packed comment": LyingFile("picture", ".png", png_of_a_text_bomb, is_large=True),
    "png, animated": LyingFile("picture", ".png", lambda: apng(40, 2000, 1000), is_large=True),
    "tiff of a 2 GB tile": LyingFile("picture", ".tif", tiff_of_a_large_tile),
    "tiff of 2^32 strips": LyingFile("picture", ".tif", tiff_of_many_values),
    "tiff of floats that are none": LyingFile("picture", ".tif", tiff_of_floats),
    "hdr with a decoy size": LyingFile("hdr", ".hdr", hdr_of_a_decoy_size, is_large=True),
    "exr, channels of two sizes": LyingFile(
        "exr", ".exr", lambda: exr_of_channels({"R": (1, 1), "G": (2, 2), "B": (2, 2)})
    ),
    "exr, a channel with a line feed": LyingFile("exr", ".exr", lambda: exr_of_channels({"\nR": (1, 1)})),
    "gif, 8192 a side": LyingFile("video", ".gif", lambda: gif_of_size(8192, 8192), is_large=True),
    "relit, 95 MB of metadata": LyingFile("subject", ".relit", subject_of_much_metadata, is_large=True),
    "relit, 66 dimensions": LyingFile("subject", ".relit", lambda: subject({"matte": ("F32", [1] * 66)})),
    "relit, a side of 2^62": LyingFile("subject", ".relit", lambda: subject({"matte": ("F32", [2**62, 0])})),
    "relit, a side of 2^63 and 0": LyingFile("subject", ".relit", lambda: subject({"matte": ("F32", [0, 2**63])})),
    "relit, 0-d first": LyingFile("subject", ".relit", lambda: subject({"basis.first": ("I32", [])})),
    "relit, 0-d values": LyingFile("subject", ".relit", lambda: subject({"basis.values": ("I8", [])})),
    "relit, 0-d pixels": LyingFile("subject", ".relit", lambda: subject({"basis.pixels": ("I32", [])})),
    "relit, empty first": LyingFile("subject", ".relit", lambda: subject({"basis.first": ("I32", [0])})),
    "npz of a 3.9 GB header": LyingFile("matte", ".npz", matte_of_a_long_header, is_large=True),
    "npz that the tokenizer refuses": LyingFile("matte", ".npz", lambda: matte("{'descr': '|u1', 'shape': (1,\n  '''")),
    "npz of a type that is no type": LyingFile(
        "matte", ".npz", lambda: matte("{'descr': [[1]], 'fortran_order': False, 'shape': (1, 2, 2), }")
    ),
    "npz of a nested header": LyingFile("matte", ".npz", lambda: matte("(" * 9000)),
    "npz that runs out of memory": LyingFile("matte", ".npz", lambda: matte("[" * 300 + "]" * 300)),
    "npz of a type of numbers": LyingFile(
        "matte", ".npz", lambda: matte("{'descr': ({}, 3), 'fortran_order': False, 'shape': (1, 2, 2), }")
    ),
    "npz by LZMA": LyingFile("matte", ".npz", matte_by_lzma),
    "npz of a future zip": LyingFile("matte", ".npz", matte_of_a_zip_version),
    "npz, encrypted": LyingFile("matte", ".npz", matte_encrypted),
    "npz of 300,000 members": LyingFile("matte", ".npz", zip_of_many_members, is_large=True),
    "mp4 whose title is no UTF-8": LyingFile("video", ".mp4", lambda: sound_video(".mp4", b"\xff\xfe\x80")),
    "mkv whose title is no UTF-8": LyingFile("video", ".mkv", lambda: sound_video(".mkv", b"\xff\xfe\x80")),
    "mkv of a far end": LyingFile("video", ".mkv", matroska_of_a_far_end),
    "mp4 of 4 million boxes": LyingFile("video", ".mp4", mp4_of_boxes, is_large=True),
    "lp of a name that is too long": LyingFile("lights", ".lp", lambda: b"4\n" + (b"a" * 300 + b".png 0 0 1\n") * 4),
    "landmarks beyond 32 bits": LyingFile(
        "landmarks", ".json", lambda: json.dumps({"openseeface66": [[1e300, 1.0]] * 66}).encode()
    ),
    "yaml !!bool x": LyingFile("yaml", ".yaml", lambda: b"a: !!bool x"),
    "yaml !!int empty": LyingFile("yaml", ".yaml", lambda: b'a: !!int ""'),
    "yaml !!float empty": LyingFile("yaml", ".yaml", lambda: b'a: !!float ""'),
    "yaml !!timestamp x": LyingFile("yaml", ".yaml", lambda: b"a: !!timestamp x"),
    "yaml, sexagesimal": LyingFile("yaml", ".yaml", lambda: b"a: 1:1" + b":1" * 50_000, is_large=True),
    "yaml, sexagesimal float": LyingFile("yaml", ".yaml", lambda: b"a: 1:1" + b":1" * 50_000 + b".5", is_large=True),
    "yaml, hex of 5000 digits": LyingFile("yaml", ".yaml", lambda: b"mode: 0x" + b"f" * 5000),
    "yaml, flow list of 1 MiB": LyingFile("yaml", ".yaml", flow_list, is_large=True),
    "yaml, nested": LyingFile("yaml", ".yaml", lambda: b"[" * 100_000, is_large=True),
    "yaml, nested maps": LyingFile("yaml", ".yaml", lambda: b"{a: " * 100_000, is_large=True),
    "yaml, merge of a number": LyingFile("yaml", ".yaml", lambda: b"<<: 1"),
    "yaml, a list as a key": LyingFile("yaml", ".yaml", lambda: b"? [a]\n: 1"),
    "yaml, a NUL": LyingFile("yaml", ".yaml", lambda: b"a: \0"),
    "yaml, two documents": LyingFile("yaml", ".yaml", lambda: b"a: 1\n---\nb: 1\n"),
}  # fmt: skip
"""What was found, by what is wrong with it."""
