"""Named background pictures in the user's data folder."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import BinaryIO

import numpy as np

from relit_camera.base.concurrency.decoding_process import DECODING_PROCESS, Decoded
from relit_camera.base.images.image_files import LDR_SUFFIXES, decode_display, encode_display, read_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.resize import shrink
from relit_camera.base.storage.named_files import NamedFiles

MAX_SIDE_PX = 3840
"""A stored picture is scaled down to this: no output is larger."""
JPEG_QUALITY = 95


class BackgroundStore(NamedFiles):
    """A folder of pictures; a background's name is its file's stem."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, "background picture", sorted(LDR_SUFFIXES))

    def load(self, name: str) -> DisplayImage:
        """Read a stored picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            NotFoundError: there is none of that name.
            ImageError: its file is damaged.
            InputError: it takes too much memory or time, or ends its decoder.
            NotReadyError: no process that decodes it can be started.
        """
        (picture,) = DECODING_PROCESS.decode(_decode, self.path(name)).arrays
        return picture

    def add(self, name: str, data: BinaryIO) -> None:
        """Store a picture file under `name`, in place of one of that name, whole or not at all.

        It is stored as a JPEG of at most 3840 pixels a side, without the place and time in a photograph's metadata.

        Raises:
            InputError: the name is not allowed, or `data` takes too much memory or time, or ends its decoder.
            ImageError: `data` is no picture that can be read.
            StorageError: it cannot be written.
            NotReadyError: no process that decodes it can be started.
        """
        with self.replacing(name, ".jpg") as temporary:
            with temporary.open("wb") as written:
                shutil.copyfileobj(data, written)
            (jpeg,) = DECODING_PROCESS.decode(_decode_for_storage, temporary).arrays
            temporary.write_bytes(jpeg.tobytes())


def _decode(path: Path) -> Decoded:
    return Decoded((read_display(path),))


def _decode_for_storage(path: Path) -> Decoded:
    jpeg = encode_display(_limit_size(decode_display(path.read_bytes())), ".jpg", JPEG_QUALITY)
    return Decoded((np.frombuffer(jpeg, np.uint8),))


def _limit_size(picture: DisplayImage) -> DisplayImage:
    return shrink(picture, MAX_SIDE_PX / max(picture.shape[:2]))
