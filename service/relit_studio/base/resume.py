"""Output folders that an interrupted command can go on filling."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from relit_camera.base.errors import InputError
from relit_camera.base.storage.atomic_files import make_folder, write_atomic


def keep_settings(folder: Path, name: str, settings: Mapping[str, object]) -> None:
    """Write the settings of a folder's content to its file `name`, or check that they equal those written there.

    Raises:
        InputError: the folder was begun with other settings.
        StorageError: it cannot be written.
    """
    make_folder(folder)
    path, text = folder / name, json.dumps(settings, indent=1)
    if path.is_file() and path.read_text(encoding="utf-8") != text:
        raise InputError(
            f"{folder} was begun with other settings, see {name}", "name another folder, or delete that one"
        )
    write_atomic(path, text)
