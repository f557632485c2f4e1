"""Files of recorded mattes: NumPy's .npz, a zip file that holds the array `alpha`, uint8 (frames, height, width)."""

from __future__ import annotations

import math
import re
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import IO
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask
from relit_camera.base.storage.atomic_files import atomic_path

MAX_RECORDED_BYTES = 1 << 30
"""Most memory that the mattes of one file may take: ten minutes of 256x256 at 30 frames a second."""
MAX_NPY_HEADER_BYTES = 4096
MAX_MEMBERS = 100
"""Of a file: NumPy makes one of each array."""

UNREADABLE_MATTES = (
    ValueError, KeyError, EOFError, RuntimeError, OverflowError, struct.error, BadZipFile, zlib.error,
)  # fmt: skip
"""What `read_mattes` raises of a damaged file, `zipfile` most of it."""

_ENCRYPTED = 1
"""Bit of a member's flags."""
_ZIP_END_BYTES = (1 << 16) + 22
"""In which the end of a zip file's directory is found."""
_MEMBER_BYTES = 400
"""More than an entry of the directory has whose name is no longer than a name of NumPy's."""
_PART_BYTES = 1 << 20
_NPY_HEADER = re.compile(
    r"\{'descr': '[|<>=]u1', 'fortran_order': False, 'shape': \((\d{1,19}), (\d{1,19}), (\d{1,19})\), \} *\n"
)


def read_mattes(path: Path) -> NDArray[np.uint8]:
    """The array `alpha` of an .npz file. Its header is checked first: a small zip may unpack to any size.

    Raises:
        Exception: of `UNREADABLE_MATTES`: it holds none, or too large a one.
        OSError: it cannot be read.
    """
    _require_few_members(path)
    with ZipFile(path) as kept:
        member = kept.getinfo("alpha.npy")  # np.load would take one called `alpha` before it
        if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED) or member.flag_bits & _ENCRYPTED:
            raise ValueError("they are packed in another way than by NumPy, or encrypted")
        with kept.open(member) as file:
            shape = _alpha_shape(file)
            count = math.prod(shape)
            if count > MAX_RECORDED_BYTES:
                raise ValueError(f"they are {count >> 20} MiB, more than {MAX_RECORDED_BYTES >> 20}")
            if not 0 < count < member.file_size:
                raise ValueError(f"they are {shape}, in a member of {member.file_size} bytes")
            alpha, done = np.empty(count, np.uint8), 0
            while done < len(alpha) and (part := file.read(min(_PART_BYTES, len(alpha) - done))):
                alpha[done : done + len(part)] = np.frombuffer(part, np.uint8)
                done += len(part)
    if done < len(alpha):
        raise ValueError("they are cut off")
    return alpha.reshape(shape)


def _require_few_members(path: Path) -> None:
    """Check that a zip file's directory is short: `ZipFile` reads all of it at once."""
    # APPNOTE.TXT, 4.3.16: the end of the directory, before a comment of up to 64 KiB, states how many there are.
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - _ZIP_END_BYTES))
        end = file.read()
    at = end.rfind(b"PK\5\6")
    if at >= 0 and len(end) >= at + 22:
        members, directory_bytes = struct.unpack_from("<HI", end, at + 10)
        if members > MAX_MEMBERS or directory_bytes > MAX_MEMBERS * _MEMBER_BYTES:
            raise ValueError(f"the file has more than {MAX_MEMBERS} members")


def _alpha_shape(file: IO[bytes]) -> tuple[int, int, int]:
    """Read the header of an .npy file of bytes in three dimensions, and nothing else: NumPy parses it as Python.

    Raises:
        ValueError: it is another, or too long.
    """
    # numpy.org/doc/stable/reference/generated/numpy.lib.format.html: a magic text, the version, and the length in 2 or
    # 4 bytes.
    start = file.read(8)
    if not start.startswith(b"\x93NUMPY"):
        raise ValueError("they are no array")
    length = int.from_bytes(file.read(2 if start[6] == 1 else 4), "little")
    if length > MAX_NPY_HEADER_BYTES:
        raise ValueError(f"the header of the array states {length} bytes")
    header = file.read(length).decode("latin-1")
    found = _NPY_HEADER.fullmatch(header)
    if found is None:
        raise ValueError(f"they are {header.strip()[:80]!r}, not bytes in three dimensions")
    return int(found[1]), int(found[2]), int(found[3])


def write_mattes(path: Path, mattes: Sequence[Mask]) -> None:
    """Write mattes (height, width) in 0..1 to an .npz file, as `alpha` in 8 bits.

    Raises:
        StorageError: the file cannot be written.
    """
    alpha = np.rint(np.clip(np.stack(mattes), 0, 1) * 255).astype(np.uint8)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, alpha=alpha)
