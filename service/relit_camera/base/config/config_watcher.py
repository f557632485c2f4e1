"""Watches the configuration file while the camera runs, and has edits applied."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import RelitError

log = logging.getLogger(__name__)

SettingsLoader = Callable[[Path], RelitSettings]
SettingsApplier = Callable[[RelitSettings, RelitSettings], RelitError | None]
_FileVersion = tuple[int, int, int] | None


class ConfigWatcher:
    """Finds edits of the configuration file and has them applied; `check` is to be called regularly.

    An edit that cannot be used is reported and changes nothing; the next edit is tried again.
    """

    def __init__(
        self,
        path: Path,
        load: SettingsLoader,
        settings: RelitSettings,
        apply: SettingsApplier,
        report: Callable[[Exception | None], None],
    ) -> None:
        """Take the file as it is now for the one that the settings were read from.

        Args:
            path: of the configuration file.
            load: reads the settings from it; raises RelitError.
            settings: the present settings.
            apply: applies an edit, given the settings before and after; returns what a person should know, or None, and
                raises RelitError if the edit cannot be used.
            report: is called with the error or note of an edit, and with None by the first edit without one.
        """
        self._path, self._load, self._settings, self._apply, self._report = path, load, settings, apply, report
        self._used = self._seen = _file_version(path)
        self._was_reported = False

    def check(self) -> None:
        """Apply an edit, once the file is the same at two calls: until then it may still be written to."""
        before, self._seen = self._seen, _file_version(self._path)
        if self._seen == self._used or self._seen != before:
            return
        self._used = self._seen
        note: Exception | None = None
        try:
            after = self._load(self._path)
            note = self._apply(self._settings, after)
            self._settings = after
        except RelitError as error:
            note = error
        except Exception as error:  # a bug must not end the watching
            note = error
        if note is not None:
            log.warning("%s was edited: %s", self._path, note)
        if note is not None or self._was_reported:
            self._report(note)
        self._was_reported = note is not None


def _file_version(path: Path) -> _FileVersion:
    """A value that changes with every edit of the file, or its replacement; None while there is no file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
