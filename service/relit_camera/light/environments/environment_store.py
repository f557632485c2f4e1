"""Named environments: six built in, and those in the user's data folder."""

from __future__ import annotations

import shutil
from collections.abc import Hashable
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

from platformdirs import user_data_path

from relit_camera.base.errors import InputError, PanoramaError
from relit_camera.base.images.image_files import encode_display, write_linear
from relit_camera.base.storage.named_files import FileVersion, NamedFiles, file_version
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.light.environments.builtin.builtin_thumbnails import builtin_thumbnail
from relit_camera.light.environments.environment_panorama import (
    PANORAMA_SUFFIXES,
    Environment,
    Panorama,
    environment_from_panorama,
    read_panorama,
    read_panorama_apart,
    require_panorama_suffix,
)
from relit_camera.light.environments.environment_thumbnail import thumbnail_image
from relit_camera.light.environments.panorama_axes import Axes, between_map_and_picture_axes
from relit_camera.light.environments.recent_environments import RecentEnvironments

RESERVED_NAMES = frozenset({*BUILTIN_NAMES, "background"})
"""Names that no file may have: the built-in ones, and `background`, which means the light of the virtual background."""


MOST_KEPT_BYTES = 16 << 20
"""Memory for panoramas that were read from files and are not in use: one of 2048x1024 takes 13 MB, of 8192x4096 200.
In use it takes twice as much."""


class EnvironmentStore(NamedFiles):
    """A folder of panorama files, one an environment, named by its stem; the built-in ones are always there.

    Files may be put there by hand. What was read last is kept while the file stays as it is (`RecentEnvironments`).
    """

    def __init__(self, folder: Path | None = None, apart: bool = False) -> None:
        """Set up; nothing is read.

        Args:
            folder: where the files are; the user's own data folder if not given.
            apart: whether files are decoded in a process of its own, as the camera does: what `read_panorama_apart`
                raises may then come from every method that reads one.
        """
        folder = user_data_path("relit-camera", appauthor=False) / "environments" if folder is None else folder
        super().__init__(folder, "environment", sorted(PANORAMA_SUFFIXES), RESERVED_NAMES)
        self._apart = apart

    def names(self) -> list[str]:
        """The built-in names, then the stored ones in alphabetical order."""
        return [*BUILTIN_NAMES, *super().names()]

    def load(self, name: str) -> Environment:
        """The environment of that name; the same object while it is in use and its file stays as it is.

        Raises:
            NotFoundError: none of that name; the cure names a close one.
            PanoramaError: its file is damaged.
        """
        if name in BUILTIN_NAMES:
            return builtin_environment(name)
        path = self.path(name)
        return _recent(path, file_version(path), self._apart)

    def resolve(self, name_or_path: str) -> Environment:
        """The environment of a stored name, else of the panorama file at that path.

        Raises:
            NotFoundError: neither a stored name nor a file.
            PanoramaError: the file is missing, by its suffix, or cannot be used.
        """
        path = Path(name_or_path)
        if name_or_path not in self.names() and (path.is_file() or path.suffix.lower() in PANORAMA_SUFFIXES):
            return environment_from_panorama(path.stem, _read(path, self._apart))
        return self.load(name_or_path)

    def thumbnail(self, name: str) -> bytes:
        """A JPEG file, 256x128 pixels, of the environment as seen from inside, the camera's side in the middle.

        Raises:
            NotFoundError, PanoramaError: as `load`.
        """
        if name in BUILTIN_NAMES:
            return builtin_thumbnail(name)
        path = self.path(name)
        return _thumbnail(path, file_version(path), self._apart)

    def add(self, name: str, source: Path, axes: Axes = "picture") -> Environment:
        """Store a panorama file and give its environment.

        It is checked first and stored whole or not at all, replacing one of that name. The file stays as it is; one in
        `map` axes becomes an .exr in `picture` axes.

        Raises:
            InputError: the name is not allowed, or taken by a built-in environment.
            PanoramaError: it cannot be used as light.
            StorageError: it cannot be written.
        """
        self.require_free_name(name)
        panorama = read_panorama(source, axes)
        with self.replacing(name, source.suffix.lower() if axes == "picture" else ".exr") as temporary:
            if axes == "picture":
                shutil.copyfile(source, temporary)
            else:
                write_linear(temporary, between_map_and_picture_axes(panorama.radiance))
        return self.load(name)

    def add_upload(self, name: str, data: BinaryIO, suffix: str) -> Environment:
        """Store a panorama file of that suffix (".hdr"), in `picture` axes, as `add` does; `data` is read to its end.

        Raises:
            InputError, PanoramaError, StorageError: as `add`.
        """
        self.require_free_name(name)
        suffix = suffix.lower()
        require_panorama_suffix(suffix, name + suffix)
        # Written and checked in the store's folder, not in /tmp: what a crash leaves here is deleted at the next start.
        with self.replacing(name, suffix) as temporary:
            with temporary.open("wb") as written:
                shutil.copyfileobj(data, written)
            try:
                _read(temporary, self._apart)
            except PanoramaError as error:
                raise PanoramaError(error.what.replace(str(temporary), name + suffix), error.cure) from error
        return self.load(name)

    def remove(self, name: str) -> None:
        """Delete a stored environment.

        Raises:
            InputError: it is built in.
            NotFoundError: none of that name.
            StorageError: the file cannot be deleted.
        """
        if name in BUILTIN_NAMES:
            raise InputError(f"'{name}' is built in and stays", "remove stored environments only")
        path = self.path(name)
        super().remove(name)
        _RECENT.forget(lambda key: _is_of_file(key, path))


def _read(path: Path, apart: bool) -> Panorama:
    return read_panorama_apart(path) if apart else read_panorama(path)


_RECENT = RecentEnvironments(MOST_KEPT_BYTES)


def _recent(path: Path, version: FileVersion, apart: bool) -> Environment:
    key = path, version
    _RECENT.forget(lambda other: other != key and _is_of_file(other, path))  # what the file was before
    return _RECENT.get(key, lambda: environment_from_panorama(path.stem, _read(path, apart)))


def _is_of_file(key: Hashable, path: Path) -> bool:
    return isinstance(key, tuple) and key[0] == path


@lru_cache(maxsize=256)
def _thumbnail(path: Path, version: FileVersion, apart: bool) -> bytes:
    return encode_display(thumbnail_image(_recent(path, version, apart).panorama))
