"""Notices that the configuration file was edited while the camera runs."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import RelitError

log = logging.getLogger(__name__)

POLL_INTERVAL_S = 1.0
STOP_TIMEOUT_S = 1.0

SettingsLoader = Callable[[Path], RelitSettings]
SettingsApplier = Callable[[RelitSettings, RelitSettings], RelitError | None]
_FileVersion = tuple[int, int, int] | None


@contextmanager
def watch_config(
    path: Path,
    load: SettingsLoader,
    settings: RelitSettings,
    apply: SettingsApplier,
    tell: Callable[[Exception | None], None],
) -> Iterator[None]:
    """Look at the file once a second within the with-statement, in a thread of its own.

    What cannot be used leaves everything as it was: it is told, and the file is waited for to change again.

    Args:
        path: of the configuration file.
        load: reads the settings from it; raises RelitError.
        settings: as they are.
        apply: takes the settings before and after; returns what a person should know, and raises RelitError where
            they cannot be used.
        tell: gets what is wrong or should be known, and None once there is no more of that.
    """
    stopping = threading.Event()
    arguments = (path, _file_version(path), load, settings, apply, tell, stopping)
    thread = threading.Thread(target=_watch, args=arguments, name="config", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join(STOP_TIMEOUT_S)


def _watch(
    path: Path,
    used: _FileVersion,
    load: SettingsLoader,
    settings: RelitSettings,
    apply: SettingsApplier,
    tell: Callable[[Exception | None], None],
    stopping: threading.Event,
) -> None:
    last = used
    told = False
    while not stopping.wait(POLL_INTERVAL_S):
        before, last = last, _file_version(path)
        if last == used or last != before:  # one that was just written may be written on
            continue
        used = last
        note: Exception | None = None
        try:
            after = load(path)
            note = apply(settings, after)
            settings = after
        except RelitError as error:
            note = error
        except Exception as error:  # a fault of ours must not end the watch
            note = error
        if note is not None:
            log.warning("%s was edited: %s", path, note)
        if note is not None or told:
            tell(note)
        told = note is not None


def _file_version(path: Path) -> _FileVersion:
    """What is another after every edit, in place or by another file; None while there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
