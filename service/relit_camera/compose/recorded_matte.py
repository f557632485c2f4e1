"""The matte `recorded:FILE`: plays back where the person was, so that nothing need be downloaded."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import IO
from zipfile import BadZipFile, ZipFile

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.compose.background import cover
from relit_camera.errors import InputError
from relit_camera.files import atomic_path
from relit_camera.space.images import Frame, Mask

MAX_BYTES = 1 << 30
"""Of all mattes in memory: ten minutes of 256x256 at 30 frames a second are that much."""
CURE = "name a file that holds `alpha`, uint8 (frames, height, width)"


class RecordedMatte:
    """Answers with the recorded matte of the frame's index; beyond the end it begins again, as a looped file does."""

    def __init__(self, path: Path) -> None:
        """Read what `write_mattes` wrote.

        Raises:
            InputError: the file is missing or holds no mattes.
        """
        try:
            self._alpha = _read_alpha(path)
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror or error}", CURE) from error
        except (ValueError, KeyError, EOFError, NotImplementedError, BadZipFile, zlib.error) as error:
            raise InputError(f"{path} holds no recorded mattes: {error}", CURE) from error

    def matte(self, frame: Frame) -> Mask:
        """Alpha of the person, float32 (height, width) of the frame in 0..1, straight.

        A frame of another shape is one that was scaled to cover its size and cut about its middle.
        """
        alpha = self._alpha[frame.index % len(self._alpha)]
        filled = cover(alpha, frame.size, cv2.INTER_LINEAR)
        return np.multiply(filled, np.float32(1 / 255), dtype=np.float32)


def _read_alpha(path: Path) -> NDArray[np.uint8]:
    """The array, after looking at its header: a few bytes of a zip may stand for any amount of memory."""
    with ZipFile(path) as kept, kept.open("alpha.npy") as file:
        shape, _, dtype = _header(file)
        if dtype != np.uint8 or len(shape) != 3 or 0 in shape:
            raise ValueError(f"they are {dtype} {shape}")
        if math.prod(shape) > MAX_BYTES:
            raise ValueError(f"they are {math.prod(shape) >> 20} MiB, more than {MAX_BYTES >> 20}")
        file.seek(0)  # the very member: np.load would take one that is called `alpha` instead
        alpha: NDArray[np.uint8] = np.lib.format.read_array(file, allow_pickle=False)
        return alpha


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(file)
    return np.lib.format.read_array_header_2_0(file)


def write_mattes(path: Path, mattes: Sequence[Mask]) -> None:
    """Keep mattes (height, width) 0..1 in 8 bits.

    Raises:
        StorageError: the file cannot be written.
    """
    alpha = np.rint(np.clip(np.stack(mattes), 0, 1) * 255).astype(np.uint8)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, alpha=alpha)
