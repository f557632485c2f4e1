"""Named background pictures in the user's data folder."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

from relit_camera.base.errors import NotFoundError
from relit_camera.base.images.image_files import LDR_SUFFIXES, decode_display, encode_display, read_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.resize import shrink
from relit_camera.base.storage import make_folder, write_atomic

MAX_SIDE_PX = 3840
"""A stored picture is scaled down to this: no output is larger."""
JPEG_QUALITY = 95


class BackgroundStore:
    """A folder of pictures; a background's name is its file's stem.

    Names come checked, as `base.config.look.StoredName`: they cannot leave the folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """Stored names in alphabetical order."""
        return sorted(self._files())

    def load(self, name: str) -> DisplayImage:
        """Read a stored picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            NotFoundError: none of that name.
            ImageError: its file is damaged.
        """
        return read_display(self._path(name))

    def add(self, name: str, data: bytes) -> None:
        """Store a picture file under `name`, in place of one of that name, whole or not at all.

        It is stored as a JPEG of at most 3840 pixels a side: without the place and time that cameras write into theirs.

        Raises:
            ImageError: `data` is no picture that can be read.
            StorageError: it cannot be written.
        """
        picture = _limit_size(decode_display(data))
        make_folder(self.folder)
        replaced = self._files().get(name)
        target = self.folder / f"{name}.jpg"
        write_atomic(target, encode_display(picture, ".jpg", JPEG_QUALITY))
        if replaced is not None and replaced != target:
            replaced.unlink(missing_ok=True)

    def remove(self, name: str) -> None:
        """Delete a stored picture.

        Raises:
            NotFoundError: none of that name.
        """
        self._path(name).unlink(missing_ok=True)

    def _path(self, name: str) -> Path:
        files = self._files()
        if name not in files:
            close = get_close_matches(name, files, 1)
            cure = f"did you mean '{close[0]}'?" if close else f"stored are: {', '.join(sorted(files)) or 'none'}"
            raise NotFoundError(f"no background picture '{name}'", cure)
        return files[name]

    def _files(self) -> dict[str, Path]:
        if not self.folder.is_dir():
            return {}
        found = (path for path in self.folder.iterdir() if path.suffix.lower() in LDR_SUFFIXES)
        return {path.stem: path for path in sorted(found) if not path.name.startswith(".")}


def _limit_size(picture: DisplayImage) -> DisplayImage:
    return shrink(picture, MAX_SIDE_PX / max(picture.shape[:2]))
