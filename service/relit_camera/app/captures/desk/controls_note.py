"""A note of a webcam's controls while they are held: if the camera is killed meanwhile, its next start puts them back.

A webcam keeps its controls until it is unplugged; without the note it would stay dark, its automatic switched off.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

import psutil
from pydantic import BaseModel, ConfigDict, ValidationError

from relit_camera.base.errors import DeviceError, StorageError
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_camera.devices.device_discovery import find_webcam
from relit_camera.devices.webcam_controls import ControlDevice, HeldControls, open_controls

log = logging.getLogger(__name__)

NOTE_NAME = "webcam-controls.json"
"""In the data folder."""
MAX_NOTE_BYTES = 1 << 16


class _Note(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    webcam: str
    """Its id, which is the same after a restart."""
    process: int
    """That holds the controls, and when it began, which tells it from a later one of the same number."""
    began_at: float
    values: dict[int, int]


class ControlsNote:
    """The note in a data folder."""

    def __init__(self, data_dir: Path, webcam_id: Callable[[], str]) -> None:
        """Set up; nothing is written.

        Args:
            data_dir: the folder.
            webcam_id: tells the id of the webcam whose controls are held.
        """
        self.path = data_dir / NOTE_NAME
        self._webcam_id = webcam_id

    @contextmanager
    def until_restored(self) -> Iterator[Callable[[Mapping[int, int]], None]]:
        """Give the function that writes the note of the values, which is deleted when the context ends.

        A note that cannot be written is no reason to refuse the capture.
        """

        def keep(values: Mapping[int, int]) -> None:
            try:
                note = _Note(
                    webcam=self._webcam_id(), process=os.getpid(), began_at=_process_time(os.getpid()), values=values
                )
                make_folder(self.path.parent)
                write_atomic(self.path, note.model_dump_json())
            except (StorageError, DeviceError) as error:
                log.warning("the webcam's controls are not noted: %s", error)

        try:
            yield keep
        finally:
            with suppress(OSError):
                self.path.unlink(missing_ok=True)


def restore_noted_controls(
    data_dir: Path,
    open_webcam: Callable[[str], AbstractContextManager[ControlDevice]] = lambda webcam: open_controls(
        find_webcam(webcam).node
    ),
) -> bool:
    """Put back the controls of a webcam that a process held when it was killed; returns whether that was so.

    A webcam that is not plugged in is tried again at the next start.

    Args:
        data_dir: where the note is.
        open_webcam: opens the controls of the webcam of an id.
    """
    path = data_dir / NOTE_NAME
    try:
        if path.stat().st_size > MAX_NOTE_BYTES:
            raise ValueError("it is too large")
        note = _Note.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return False
    except (OSError, ValueError, ValidationError) as error:
        log.warning("%s cannot be used: %s", path, error)
        with suppress(OSError):
            path.unlink(missing_ok=True)
        return False
    if _process_time(note.process) == note.began_at:
        return False  # it runs, and holds them
    try:
        with open_webcam(note.webcam) as device:
            HeldControls(device, {}, note.values).restore()
    except DeviceError as error:
        log.warning("the controls of webcam %s were held when the camera was killed: %s", note.webcam, error)
        return False
    log.info("the controls of webcam %s are put back, which were held when the camera was killed", note.webcam)
    with suppress(OSError):
        path.unlink(missing_ok=True)
    return True


def _process_time(process: int) -> float:
    """When a process began, in seconds since the epoch; -1 where there is none."""
    try:
        return psutil.Process(process).create_time()
    except (psutil.Error, ValueError):
        return -1.0
