"""Named environments: six built in, and those in the user's data folder."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path

from platformdirs import user_data_path
from pydantic import TypeAdapter, ValidationError

from relit_camera.base.config.look import StoredName
from relit_camera.base.errors import InputError, NotFoundError, PanoramaError, StorageError
from relit_camera.base.images.image_files import encode_display, write_linear
from relit_camera.base.storage import atomic_path, make_folder
from relit_camera.light.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.light.environment_panorama import (
    PANORAMA_SUFFIXES,
    Environment,
    environment_from_panorama,
    read_panorama,
    require_panorama_suffix,
)
from relit_camera.light.environment_thumbnail import thumbnail_image
from relit_camera.light.panorama_axes import Axes, between_map_and_picture_axes

RESERVED_NAMES = frozenset({*BUILTIN_NAMES, "background"})
"""Names that no file may have: the built-in ones, and the word for: lit by the virtual background."""

_name = TypeAdapter[str](StoredName)


class EnvironmentStore:
    """A folder of panorama files, one an environment, named by its stem; the built-in ones are always there.

    Files may be put there by hand. What was read is kept while the file stays as it is.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder if folder is not None else user_data_path("relit-camera") / "environments"

    def names(self) -> list[str]:
        """The built-in names, then the stored ones in alphabetical order."""
        return [*BUILTIN_NAMES, *sorted(self._files())]

    def load(self, name: str) -> Environment:
        """The environment of that name; the same object again until its file changes.

        Raises:
            NotFoundError: none of that name; the cure names a close one.
            PanoramaError: its file is damaged.
        """
        if name in BUILTIN_NAMES:
            return builtin_environment(name)
        path = self._file(name)
        return _read_cached(path, _file_version(path))

    def resolve(self, name_or_path: str) -> Environment:
        """The environment of a stored name, else of the panorama file at that path.

        Raises:
            NotFoundError: neither a stored name nor a file.
            PanoramaError: the file is missing, by its suffix, or cannot be used.
        """
        path = Path(name_or_path)
        if name_or_path not in self.names() and (path.is_file() or path.suffix.lower() in PANORAMA_SUFFIXES):
            return environment_from_panorama(path.stem, read_panorama(path))
        return self.load(name_or_path)

    def thumbnail(self, name: str) -> bytes:
        """A JPEG, 256x128, of the environment as seen from inside, the camera's side in the middle.

        Raises:
            NotFoundError, PanoramaError: as `load`.
        """
        if name in BUILTIN_NAMES:
            return _builtin_thumbnail(name)
        path = self._file(name)
        return _thumbnail(path, _file_version(path))

    def add(self, name: str, source: Path, axes: Axes = "picture") -> Environment:
        """Store a panorama file and give its environment.

        It is checked first and stored whole or not at all, replacing one of that name. The file stays as it is; one in
        `map` axes becomes an .exr in `picture` axes.

        Raises:
            InputError: the name is not allowed, or taken by a built-in environment.
            PanoramaError: it cannot be used as light.
            StorageError: it cannot be written.
        """
        _require_free_name(name)
        panorama = read_panorama(source, axes)
        with self._place(name, source.suffix.lower() if axes == "picture" else ".exr") as temporary:
            if axes == "picture":
                shutil.copyfile(source, temporary)
            else:
                write_linear(temporary, between_map_and_picture_axes(panorama.radiance))
        return self.load(name)

    def add_upload(self, name: str, data: bytes, suffix: str) -> Environment:
        """Store the bytes of a panorama file of that suffix (".hdr"), in `picture` axes, as `add` does.

        Raises:
            InputError, PanoramaError, StorageError: as `add`.
        """
        _require_free_name(name)
        suffix = suffix.lower()
        require_panorama_suffix(suffix, name + suffix)
        # Checked where it will be, not in a folder for temporary files: what a crash leaves there nobody sweeps.
        with self._place(name, suffix) as temporary:
            temporary.write_bytes(data)
            try:
                read_panorama(temporary)
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
        path = self._file(name)
        try:
            self._unlink_all(name)
        except OSError as error:
            raise StorageError(f"cannot delete {path}: {error.strerror}", "check the folder's permissions") from error

    @contextmanager
    def _place(self, name: str, suffix: str) -> Iterator[Path]:
        """A temporary path to write to, which on success becomes the only file of that name."""
        make_folder(self.folder)
        target = self.folder / f"{name}{suffix}"
        with atomic_path(target) as temporary:
            yield temporary
        self._unlink_all(name, but=target)

    def _unlink_all(self, name: str, but: Path | None = None) -> None:
        """Delete the files of a name, also those that another of that name hides."""
        for path in self.folder.iterdir():
            if path.stem == name and path.suffix.lower() in PANORAMA_SUFFIXES and path != but:
                path.unlink(missing_ok=True)

    def _file(self, name: str) -> Path:
        files = self._files()
        if name in files:
            return files[name]
        close = get_close_matches(name, self.names(), 3, 0.5)
        cure = f"did you mean {' or '.join(close)}?" if close else f"there are: {', '.join(self.names())}"
        raise NotFoundError(f"no environment '{name}'", cure)

    def _files(self) -> dict[str, Path]:
        """Panorama files by name. Of two with one name the HDR one counts: its suffix comes first."""
        found = sorted(self.folder.iterdir(), reverse=True) if self.folder.is_dir() else []
        usable = (path for path in found if path.suffix.lower() in PANORAMA_SUFFIXES and _is_name(path.stem))
        return {path.stem: path for path in usable if path.stem not in RESERVED_NAMES}


def _is_name(text: str) -> bool:
    try:
        _name.validate_python(text)
    except ValidationError:
        return False
    return True


def _require_free_name(name: str) -> None:
    if not _is_name(name):
        cure = "use up to 64 letters, digits, spaces, dots, dashes and underscores, a letter or digit first"
        raise InputError(f"'{name}' cannot name an environment", cure)
    if name in RESERVED_NAMES:
        raise InputError(f"'{name}' is a name of our own", "choose another name")


def _file_version(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=4)
def _read_cached(path: Path, version: tuple[int, int]) -> Environment:
    return environment_from_panorama(path.stem, read_panorama(path))


@lru_cache(maxsize=256)
def _thumbnail(path: Path, version: tuple[int, int]) -> bytes:
    return encode_display(thumbnail_image(_read_cached(path, version).panorama))


@lru_cache(maxsize=len(BUILTIN_NAMES))
def _builtin_thumbnail(name: str) -> bytes:
    return encode_display(thumbnail_image(builtin_environment(name).panorama))
