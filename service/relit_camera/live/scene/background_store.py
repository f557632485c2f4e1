"""Named background pictures in the user's data folder."""

from __future__ import annotations

from pathlib import Path

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
        """
        return read_display(self.path(name))

    def add(self, name: str, data: bytes) -> None:
        """Store a picture file under `name`, in place of one of that name, whole or not at all.

        It is stored as a JPEG of at most 3840 pixels a side, without the place and time in a photograph's metadata.

        Raises:
            InputError: the name is not allowed.
            ImageError: `data` is no picture that can be read.
            StorageError: it cannot be written.
        """
        self.write(name, ".jpg", encode_display(_limit_size(decode_display(data)), ".jpg", JPEG_QUALITY))


def _limit_size(picture: DisplayImage) -> DisplayImage:
    return shrink(picture, MAX_SIDE_PX / max(picture.shape[:2]))
