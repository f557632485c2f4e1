"""Named subjects in the user's data folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from relit_camera.base.concurrency.decoding_process import DECODING_PROCESS, Decoded
from relit_camera.base.config.look import ANYONE
from relit_camera.base.errors import ConflictError, NotFoundError, SubjectError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import make_folder, storage_error
from relit_camera.base.storage.named_files import NamedFiles
from relit_camera.subject.subject import Subject, SubjectMetadata
from relit_camera.subject.subject_file import SUFFIX, read_metadata, read_neutral, read_subject


class SubjectStore(NamedFiles):
    """A folder of .relit files; a subject's name is its file's stem."""

    def __init__(self, folder: Path, copied: bool = False) -> None:
        """Set up; nothing is read.

        Args:
            folder: where the files are.
            copied: whether a copy of a file is mapped, not the file (see `read_subject`).
        """
        # Subjects come into the folder by hand (`relit capture --out`), so their names may be any file's.
        super().__init__(folder, "subject", [SUFFIX], any_name=True, reserved=frozenset({ANYONE}))
        self._copied = copied

    def new_path(self, name: str) -> Path:
        """Where a subject of that name is to be written, by `write_subject`; the folder is created where it is missing.

        Raises:
            InputError: the name is not allowed.
            StorageError: the folder cannot be created.
        """
        self.require_free_name(name)
        make_folder(self.folder)
        return self.folder / f"{name}{SUFFIX}"

    @contextmanager
    def adding(self, name: str, called: str) -> Iterator[Path]:
        """Give a path to write a subject's file to, which on success becomes the subject of that name.

        Args:
            name: of the new subject.
            called: what the file is called in messages.

        Raises:
            ConflictError: there is one of that name.
            SubjectError: what was written is no subject, or too large.
            InputError: the name is not allowed, or what was written takes too much memory or time to be read.
            StorageError: it cannot be written.
            NotReadyError: no process that checks it can be started.
        """
        self._require_new(name)
        with self.replacing(name, SUFFIX) as path:
            yield path
            try:
                DECODING_PROCESS.decode(_check_subject, path, self._copied)
            except SubjectError as error:
                raise SubjectError(error.what.replace(str(path), f"'{called}'"), error.cure) from error
            self._require_new(name)

    def rename(self, name: str, new_name: str) -> None:
        """Give a stored subject another name.

        Raises:
            NotFoundError: there is none of the old name.
            ConflictError: there is one of the new name.
            InputError: the new name is not allowed.
            StorageError: it cannot be renamed.
        """
        path = self.path(name)
        if new_name == name:
            return
        target = self.new_path(new_name)
        self._require_new(new_name)
        try:
            path.rename(target)
        except OSError as error:
            raise storage_error(target, error) from error

    def load(self, name: str) -> Subject:
        """Read a stored subject.

        Raises:
            NotFoundError: there is none of that name.
            SubjectError: its file is damaged, or too large.
        """
        return read_subject(self.path(name), self._copied)

    def load_file(self, path: Path) -> tuple[str, Subject]:
        """Read a subject's file anywhere. Returns the name to show, which is the file's stem, and the subject.

        Raises:
            NotFoundError: there is no such file.
            SubjectError: it is damaged, or too large.
        """
        if not path.exists():
            raise NotFoundError(f"no subject file {path}", "check the path")
        return path.stem, read_subject(path, self._copied)

    def metadata(self, name: str) -> SubjectMetadata:
        """The header of a stored subject's file, which is read alone, whatever the size of the file.

        Raises:
            NotFoundError, SubjectError: as `load`.
        """
        return read_metadata(self.path(name))

    def neutral(self, name: str) -> DisplayImage:
        """A stored subject's neutral picture, uint8 sRGB RGB (height, width, 3), whatever the size of its file.

        Raises:
            NotFoundError, SubjectError: as `load`.
        """
        return read_neutral(self.path(name))

    def _require_new(self, name: str) -> None:
        if name in self.names():
            raise ConflictError(f"there is a subject '{name}' already", "choose another name, or delete that one")

    def resolve(self, name_or_path: str) -> tuple[str, Subject]:
        """Read what a person named: a stored subject, else a file. Returns the name to show and the subject.

        For names from the command line and the configuration only: a name that came over the API must not reach a file.

        Raises:
            NotFoundError: neither a stored name nor a file.
            SubjectError: the file is damaged, or too large.
        """
        if name_or_path not in self.names() and Path(name_or_path).exists():
            return self.load_file(Path(name_or_path))
        return name_or_path, self.load(name_or_path)


def _check_subject(path: Path, copied: bool) -> Decoded:
    read_subject(path, copied)
    return Decoded()
