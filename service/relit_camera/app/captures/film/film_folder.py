"""The files of the capture from a film in the data folder: the film, what was made of it so far, and a record.

They are pictures of a person: nobody but the owner may enter the folder. The film is deleted once its subject is
stored.
"""

from __future__ import annotations

import logging
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from relit_camera.base.errors import InputError, NotFoundError, StorageError
from relit_camera.base.storage.atomic_files import atomic_path, make_folder, write_atomic
from relit_camera.base.storage.folder_lock import FolderLock
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
    """The folder of one capture at a time, which one process at a time may write to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = FolderLock(folder)

    def take(self) -> bool:
        """Create the folder where it is missing, and take it; returns whether this process may write to it now.

        Raises:
            StorageError: it cannot be created.
        """
        make_folder(self.folder, private=True)
        return self._lock.take()

    def take_if_there(self) -> bool:
        """Take the folder, if it is there; returns whether this process has it now."""
        return self.folder.is_dir() and self._lock.take()

    def release(self) -> None:
        """Let another process write to the folder. Harmless when repeated."""
        self._lock.release()

    @contextmanager
    def receiving(self, record: FilmRecord) -> Iterator[Path]:
        """Give a path to write the film of a record to.

        Both replace what is there, and all that was made of it, when the block ends; if it fails, everything stays.

        Raises:
            StorageError: they cannot be written.
        """
        film = self.folder / record.film
        with atomic_path(film) as path:
            yield path
        try:
            self.write(record)
        except BaseException:
            film.unlink(missing_ok=True)
            raise
        self._clear(but=RECORD_NAME, and_but=record.film)

    def read(self) -> FilmRecord | None:
        """The record; None where there is none, or a damaged one.

        Raises:
            StorageError: it cannot be read, though it may be sound.
        """
        path = self.folder / RECORD_NAME
        try:
            if path.stat().st_size > MAX_RECORD_BYTES:
                raise ValueError("it is too large")
            return FilmRecord.model_validate_json(path.read_bytes())
        except FileNotFoundError:
            return None
        except OSError as error:
            what = f"cannot read {path}: {error.strerror}"
            raise StorageError(what, "check your permission to read it, and the disk") from error
        except (ValueError, ValidationError) as error:
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

    def keep_film(self, record: FilmRecord) -> None:
        """Delete every other film: one that was received when the camera was killed."""
        for path in self.folder.glob("film-*"):
            if path.name != record.film:
                with suppress(OSError):
                    path.unlink()

    def keep_result(self) -> None:
        """Delete the film and what was made of it, but for the record and the report's pictures."""
        self._clear(but=RECORD_NAME, and_but=PICTURES)

    def forget(self) -> None:
        """Delete everything in the folder."""
        self._clear()

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


def new_film_name(suffix: str) -> str:
    """The name of a film's file in the folder, other than that of the film that is there."""
    return f"film-{secrets.token_hex(4)}{suffix}"


def film_suffix(file_name: str) -> str:
    """The suffix of a film's or video's name, in lower case.

    Raises:
        InputError: none that is taken.
    """
    suffix = Path(file_name).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"'{file_name[:80]}' is no film by its name", f"send one of {', '.join(SUFFIXES)}")
    return suffix
