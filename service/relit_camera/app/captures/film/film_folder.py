"""The files of the capture from a film in the data folder: the film, what was made of it so far, and a record.

They are pictures of a person: nobody but the owner may enter the folder. The film is deleted once its subject is
stored.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from relit_camera.base.errors import InputError, NotFoundError
from relit_camera.base.storage.atomic_files import atomic_path, make_folder, write_atomic
from relit_camera.base.storage.named_files import is_valid_name
from relit_camera.live.status.film_status import FilmOptions, FilmReport

log = logging.getLogger(__name__)

SUFFIXES = (".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi")
"""Of films and videos that are taken."""
RECORD_NAME = "capture.json"
MAX_RECORD_BYTES = 1 << 20
PICTURES = "pictures"
"""The folder of the report's pictures."""


class RecordedState(StrEnum):
    """What became of a capture."""

    BEGUN = "begun"
    """It runs, or the camera ended meanwhile."""
    DONE = "done"
    FAILED = "failed"
    CANCELED = "canceled"


class FilmRecord(BaseModel):
    """A capture as it is kept over a restart."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    subject: str
    """Name under which the subject is stored."""
    file_name: str
    """Of the film as it was sent."""
    film: str
    """Name of the film's file in the folder."""
    options: FilmOptions
    state: RecordedState = RecordedState.BEGUN
    what: str = ""
    cure: str = ""
    report: FilmReport | None = None


class FilmFolder:
    """The folder of one capture at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextmanager
    def receiving(self, suffix: str) -> Iterator[Path]:
        """Give a path to write a film to, which on success replaces the one that is there, and all that was made of it.

        Raises:
            StorageError: it cannot be written.
        """
        make_folder(self.folder, private=True)
        with atomic_path(self.folder / f"received{suffix}") as path:
            yield path
        self._clear(but=f"received{suffix}")
        (self.folder / f"received{suffix}").rename(self.folder / f"film{suffix}")

    def read(self) -> FilmRecord | None:
        """The record; None where there is none that can be used."""
        path = self.folder / RECORD_NAME
        try:
            if path.stat().st_size > MAX_RECORD_BYTES:
                raise ValueError("it is too large")
            return FilmRecord.model_validate_json(path.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, ValueError, ValidationError) as error:
            log.warning("%s cannot be used: %s", path, error)
            return None

    def write(self, record: FilmRecord) -> None:
        """Keep a record.

        Raises:
            StorageError: it cannot be written.
        """
        make_folder(self.folder, private=True)
        write_atomic(self.folder / RECORD_NAME, record.model_dump_json())

    def film(self, record: FilmRecord) -> Path | None:
        """The film of a record; None where it is not there any more."""
        path = self.folder / Path(record.film).name
        return path if path.is_file() else None

    def picture(self, name: str) -> bytes:
        """A JPEG file of the report.

        Raises:
            NotFoundError: there is none of that name.
        """
        try:
            if is_valid_name(name):
                return (self.folder / PICTURES / f"{name}.jpg").read_bytes()
        except OSError as error:
            log.info("no picture %s: %s", name, error)
        raise NotFoundError(f"no picture '{name}'", "see the report")

    def keep_result(self) -> None:
        """Delete the film and what was made of it, but for the record and the report's pictures."""
        self._clear(but=RECORD_NAME, and_but=PICTURES)

    def forget(self) -> None:
        """Delete everything."""
        self._clear()
        with suppress(OSError):
            self.folder.rmdir()

    def _clear(self, but: str = "", and_but: str = "") -> None:
        try:
            entries = [path for path in self.folder.iterdir() if path.name not in (but, and_but)]
        except OSError:
            return
        for path in entries:
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                with suppress(OSError):
                    path.unlink()


def film_suffix(file_name: str) -> str:
    """The suffix of a film's or video's name, in lower case.

    Raises:
        InputError: none that is taken.
    """
    suffix = Path(file_name).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"'{file_name[:80]}' is no film by its name", f"send one of {', '.join(SUFFIXES)}")
    return suffix
