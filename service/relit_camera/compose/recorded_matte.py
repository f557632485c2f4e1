"""The matte `recorded:FILE`: plays back where the person was, so that nothing need be downloaded."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path
from zipfile import BadZipFile

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.compose.background import cover
from relit_camera.errors import InputError
from relit_camera.files import atomic_path
from relit_camera.space.images import Frame, Mask


class RecordedMatte:
    """Answers with the recorded matte of the frame's index; beyond the end it begins again, as a looped file does."""

    def __init__(self, path: Path) -> None:
        """Read what `write_mattes` wrote.

        Raises:
            InputError: the file is missing or holds no mattes.
        """
        cure = "name a file that holds `alpha`, uint8 (frames, height, width)"
        try:
            with path.open("rb") as file, np.load(file) as kept:
                self._alpha: NDArray[np.uint8] = kept["alpha"]
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror or error}", cure) from error
        except (ValueError, TypeError, KeyError, EOFError, BadZipFile, zlib.error) as error:  # TypeError: a bare .npy
            raise InputError(f"{path} holds no recorded mattes: {error}", cure) from error
        if self._alpha.dtype != np.uint8 or self._alpha.ndim != 3 or 0 in self._alpha.shape:
            raise InputError(f"the mattes in {path} are {self._alpha.dtype} {self._alpha.shape}", cure)

    def matte(self, frame: Frame) -> Mask:
        """Alpha of the person, float32 (height, width) of the frame in 0..1, straight.

        A frame of another shape is one that was scaled to cover its size and cut about its middle.
        """
        alpha = self._alpha[frame.index % len(self._alpha)]
        filled = cover(alpha, frame.size, cv2.INTER_LINEAR)
        return np.multiply(filled, np.float32(1 / 255), dtype=np.float32)


def write_mattes(path: Path, mattes: Sequence[Mask]) -> None:
    """Keep mattes (height, width) 0..1 in 8 bits.

    Raises:
        StorageError: the file cannot be written.
    """
    alpha = np.rint(np.clip(np.stack(mattes), 0, 1) * 255).astype(np.uint8)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, alpha=alpha)
