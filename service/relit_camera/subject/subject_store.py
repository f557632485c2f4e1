"""Named subjects in the user's data folder."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

from relit_camera.base.errors import NotFoundError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.subject.subject import Subject, SubjectMetadata
from relit_camera.subject.subject_file import SUFFIX, read_metadata, read_neutral, read_subject


class SubjectStore:
    """A folder of .relit files; a subject's name is its file's stem."""

    def __init__(self, folder: Path, in_memory: bool = False) -> None:
        """`in_memory`: subjects are read into memory, not mapped (see `read_subject`)."""
        self.folder = folder
        self._in_memory = in_memory

    def names(self) -> list[str]:
        """Stored names in alphabetical order."""
        # Hidden files are temporary ones of a write under way.
        return sorted(path.stem for path in self.folder.glob(f"[!.]*{SUFFIX}"))

    def path(self, name: str) -> Path:
        """The file of a stored subject.

        Raises:
            NotFoundError: none of that name.
        """
        if name not in self.names():
            close = get_close_matches(name, self.names(), 1)
            cure = f"did you mean '{close[0]}'?" if close else f"stored are: {', '.join(self.names()) or 'none'}"
            raise NotFoundError(f"no subject '{name}'", cure)
        return self.folder / f"{name}{SUFFIX}"

    def load(self, name: str) -> Subject:
        """Open a stored subject.

        Raises:
            NotFoundError: none of that name.
            SubjectError: its file is damaged, or too large.
        """
        return read_subject(self.path(name), self._in_memory)

    def metadata(self, name: str) -> SubjectMetadata:
        """What a stored subject's header says, whatever the size of its file.

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

    def resolve(self, name_or_path: str) -> tuple[str, Subject]:
        """A stored name first, else a path. Returns the name to show and the subject.

        Raises:
            NotFoundError: neither a stored name nor a file.
            SubjectError: its file is damaged.
        """
        if name_or_path in self.names():
            return name_or_path, self.load(name_or_path)
        path = Path(name_or_path)
        if not path.exists():
            self.path(name_or_path)
        return path.stem, read_subject(path, self._in_memory)

    def remove(self, name: str) -> None:
        """Delete a stored subject.

        Raises:
            NotFoundError: none of that name.
        """
        self.path(name).unlink()
