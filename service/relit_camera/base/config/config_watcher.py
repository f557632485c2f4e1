"""Watches the configuration file while the camera runs, and has edits applied."""

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
    report: Callable[[Exception | None], None],
) -> Iterator[None]:
    """Check the file for edits once a second within the with-statement, in a thread of its own.

    An edit that cannot be used is reported and changes nothing; the next edit is tried again.

    Args:
        path: of the configuration file.
        load: reads the settings from it; raises RelitError.
        settings: the present settings.
        apply: applies an edit, given the settings before and after; returns what a person should know, or None, and
            raises RelitError if the edit cannot be used.
        report: is called with the error or note of an edit, and with None by the first edit without one.
    """
    stopping = threading.Event()
    arguments = (path, _file_version(path), load, settings, apply, report, stopping)
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
    report: Callable[[Exception | None], None],
    stopping: threading.Event,
) -> None:
    last = used
    was_reported = False
    while not stopping.wait(POLL_INTERVAL_S):
        before, last = last, _file_version(path)
        if last == used or last != before:  # a file that was just written may still be written to
            continue
        used = last
        note: Exception | None = None
        try:
            after = load(path)
            note = apply(settings, after)
            settings = after
        except RelitError as error:
            note = error
        except Exception as error:  # a bug must not end the watching
            note = error
        if note is not None:
            log.warning("%s was edited: %s", path, note)
        if note is not None or was_reported:
            report(note)
        was_reported = note is not None


def _file_version(path: Path) -> _FileVersion:
    """A value that changes with every edit of the file, or its replacement; None while there is no file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
