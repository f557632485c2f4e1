"""A folder of files that are found by name: the storage of environments, subjects, backgrounds and presets.

The store of each kind is a subclass that adds only how its files are read and written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path

from relit_camera.base.errors import InputError, NotFoundError, StorageError
from relit_camera.base.storage.atomic_files import atomic_path, make_folder

NAME_PATTERN = r"^[A-Za-z0-9]([A-Za-z0-9 _.-]{0,62}[A-Za-z0-9_-])?$"
"""What names are made of: letters, digits, space, dot, dash and underscore; a letter or digit first, and no dot or
space last. Such a name cannot leave its folder, and every file system takes it."""
NAME_RULE = "use up to 64 letters, digits, spaces, dots, dashes and underscores, a letter or digit first"

_WINDOWS_DEVICE_NAMES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9]) *(\..*)?", re.IGNORECASE)
"""Names that stand for devices on Windows, in every folder and with every suffix."""

TYPO_SIMILARITY = 0.6
"""From this ratio of `difflib` on a name is offered in place of a wrong one. Of slips on the six built-in environments
(a letter lost, doubled, replaced, two swapped) it finds every one; at 0.5 'forest' would become 'overcast' as well."""

FileVersion = tuple[int, int]
"""Time of the last change in nanoseconds and size in bytes: a file's content is the same while both are."""


def require_portable_name(name: str) -> str:
    """Give the name back if files may have it on every system.

    Raises:
        ValueError: it stands for a device on Windows.
    """
    if _WINDOWS_DEVICE_NAMES.fullmatch(name):
        raise ValueError(f"'{name}' is a device on Windows")
    return name


def is_valid_name(name: str) -> bool:
    """Whether a stored file may have the name on every system (see `NAME_PATTERN`)."""
    return bool(re.fullmatch(NAME_PATTERN, name)) and not _WINDOWS_DEVICE_NAMES.fullmatch(name)


class NamedFiles:
    """The files of one kind in a folder, each named by its file name without the suffix.

    The folder is read at each call: a person may add and delete files by hand. It need not exist. Hidden files, such as
    those that are being written, do not count. Every method that looks at the folder raises StorageError where it may
    not be read.

    Attributes:
        folder: where the files are.
        kind: what they are called in messages, such as `environment`.
        suffixes: of their files, in lower case. Of two files with one name that of the first suffix counts.
    """

    def __init__(
        self,
        folder: Path,
        kind: str,
        suffixes: Sequence[str],
        reserved: frozenset[str] = frozenset(),
        any_name: bool = False,
    ) -> None:
        """Set up; nothing is read or created.

        Args:
            folder: where the files are.
            kind: what they are called in messages.
            suffixes: of their files, in lower case, the preferred one first.
            reserved: names that no file may have.
            any_name: whether files with names outside `NAME_PATTERN`, put there by hand, count too.
        """
        self.folder, self.kind, self.suffixes = folder, kind, tuple(suffixes)
        self._reserved, self._any_name = reserved, any_name

    def names(self) -> list[str]:
        """The names in alphabetical order."""
        return sorted(self._paths())

    def path(self, name: str) -> Path:
        """The file of a name. Only files of the folder are found, whatever the name looks like.

        Raises:
            NotFoundError: there is none; the cure offers similar names, or all.
        """
        paths = self._paths()
        if name in paths:
            return paths[name]
        offered = self.names()
        close = " or ".join(f"'{other}'" for other in _similar_names(name, offered))
        cure = f"did you mean {close}?" if close else f"there are: {', '.join(offered) or 'none'}"
        raise NotFoundError(f"no {self.kind} '{name}'", cure)

    @contextmanager
    def replacing(self, name: str, suffix: str) -> Iterator[Path]:
        """Give a temporary path to write to, which on success becomes the only file of that name.

        The folder is created where it is missing. On a failure everything stays as it was (see `atomic_path`).

        Raises:
            InputError: the name is not allowed.
            StorageError: the file cannot be written.
        """
        self.require_free_name(name)
        make_folder(self.folder)
        target = self.folder / f"{name}{suffix}"
        with atomic_path(target) as temporary:
            yield temporary
        self._delete(path for path in self._all_paths(name) if path != target)

    def write(self, name: str, suffix: str, data: bytes | str) -> None:
        """Store `data` (text as UTF-8) as the only file of that name, whole or not at all.

        Raises:
            InputError, StorageError: as `replacing`.
        """
        with self.replacing(name, suffix) as temporary:
            temporary.write_bytes(data.encode() if isinstance(data, str) else data)

    def remove(self, name: str) -> None:
        """Delete the file of a name, and others of that name with another suffix.

        Raises:
            NotFoundError: as `path`.
            StorageError: it cannot be deleted.
        """
        self.path(name)
        self._delete(self._all_paths(name))

    def require_free_name(self, name: str) -> None:
        """Check that a file may get this name; one that is there may be replaced.

        Raises:
            InputError: it is reserved, or not made as `NAME_PATTERN` says.
        """
        if not is_valid_name(name):
            article = "an" if self.kind[0] in "aeiou" else "a"
            raise InputError(f"'{name}' cannot name {article} {self.kind}", NAME_RULE)
        if name in self._reserved:
            raise InputError(f"'{name}' is a reserved name", "choose another name")

    def _paths(self) -> dict[str, Path]:
        found: dict[str, Path] = {}
        # The last one of a name wins, so the preferred suffix comes last.
        for path in sorted(self._files(), key=lambda path: -self.suffixes.index(path.suffix.lower())):
            if path.stem not in self._reserved and (self._any_name or is_valid_name(path.stem)):
                found[path.stem] = path
        return found

    def _all_paths(self, name: str) -> list[Path]:
        """The files of a name: also those that another of that name hides, as a crash while replacing leaves them."""
        return [path for path in self._files() if path.stem == name]

    def _files(self) -> list[Path]:
        try:
            entries = list(self.folder.iterdir())
        except (FileNotFoundError, NotADirectoryError):
            return []
        except OSError as error:
            raise StorageError(f"cannot read {self.folder}: {error.strerror}", "check its permissions") from error
        visible = (path for path in entries if not path.name.startswith("."))
        return [path for path in visible if path.suffix.lower() in self.suffixes]

    def _delete(self, paths: Iterator[Path] | list[Path]) -> None:
        for path in paths:
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                cure = "check the folder's permissions"
                raise StorageError(f"cannot delete {path}: {error.strerror}", cure) from error


def _similar_names(name: str, names: Sequence[str]) -> list[str]:
    """Up to three of `names` that a person may have meant by `name`; upper and lower case are the same."""
    by_lower = {other.lower(): other for other in names}
    return [by_lower[found] for found in get_close_matches(name.lower(), by_lower, 3, TYPO_SIMILARITY)]


def file_version(path: Path) -> FileVersion:
    """The present version of a file, as a key for caches of what was read from it.

    Raises:
        OSError: it cannot be looked at.
    """
    status = path.stat()
    return status.st_mtime_ns, status.st_size
