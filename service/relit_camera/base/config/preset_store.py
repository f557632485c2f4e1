"""Named looks in the user's data folder: one YAML file each."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from relit_camera.base.config.look import Preset
from relit_camera.base.errors import ConflictError, InputError, StorageError
from relit_camera.base.safe_yaml import MAX_YAML_BYTES, parse_yaml, yaml_text
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_camera.base.storage.named_files import NamedFiles

PRESET_SUFFIX = ".yaml"
AT_START_FILE = "at-start"
"""Beside the presets: the name of the one that is shown at the start."""
MAX_NAME_LENGTH = 80


class PresetStore(NamedFiles):
    """A folder of YAML files, each a whole `Preset`; a preset's name is its file's stem."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, "preset", [PRESET_SUFFIX])

    def load(self, name: str) -> Preset:
        """Read a preset.

        Raises:
            NotFoundError: there is none of that name.
            InputError: the file is not a valid preset: a person edited it, or another version wrote it.
        """
        try:
            return read_preset(self.path(name))
        except ValueError as error:
            raise InputError(
                f"preset '{name}' cannot be read: {error}", "correct its file, or save it again"
            ) from error

    def save(self, name: str, preset: Preset) -> bool:
        """Write a preset whole or not at all, in place of one of that name. Returns whether it is new.

        Raises:
            InputError: the name is not allowed.
            StorageError: it cannot be written.
        """
        is_new = name not in self.names()
        self.write(name, PRESET_SUFFIX, preset_text(preset))
        return is_new

    def rename(self, name: str, new: str) -> None:
        """Give a preset another name; the one at start stays so.

        Raises:
            NotFoundError: there is none of that name.
            ConflictError: there is one of the new name.
            InputError: the new name is not allowed.
            StorageError: it cannot be renamed.
        """
        path = self.path(name)
        if new == name:
            return
        self.require_free_name(new)
        if new in self.names():
            raise ConflictError(f"a preset '{new}' exists already", "choose another name")
        at_start = self.at_start() == name
        try:
            path.rename(path.with_name(f"{new}{path.suffix}"))
        except OSError as error:
            raise StorageError(f"cannot rename {path}: {error.strerror}", "check the folder's permissions") from error
        if at_start:
            self.set_at_start(new)

    def remove(self, name: str) -> None:
        """Delete a preset; see `NamedFiles.remove`."""
        super().remove(name)
        if self._noted_at_start() == name:
            self.set_at_start(None)

    def at_start(self) -> str | None:
        """The preset that is shown when the camera starts; None if none is, or its file is gone."""
        name = self._noted_at_start()
        return name if name in self.names() else None

    def set_at_start(self, name: str | None) -> None:
        """Show a preset when the camera starts, in place of another one; or none.

        Raises:
            NotFoundError: there is none of that name.
            StorageError: it cannot be noted.
        """
        if name is not None:
            self.path(name)
        elif self._noted_at_start() is None:
            return
        make_folder(self.folder)
        write_atomic(self.folder / AT_START_FILE, f"{name or ''}\n")

    def _noted_at_start(self) -> str | None:
        try:
            with (self.folder / AT_START_FILE).open(encoding="utf-8") as file:
                return file.readline(MAX_NAME_LENGTH).strip() or None
        except (OSError, ValueError):
            return None


def read_preset(path: Path) -> Preset:
    """Read a preset's file.

    Raises:
        ValueError: it cannot be read, or is not a valid preset; the message says why.
    """
    try:
        if path.stat().st_size > MAX_YAML_BYTES:
            raise ValueError(f"it is larger than {MAX_YAML_BYTES >> 20} MiB")
        return Preset.model_validate(parse_yaml(path.read_text(encoding="utf-8")))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    except (OSError, ValueError) as error:
        raise ValueError(str(error).strip(" :")) from error


def preset_text(preset: Preset) -> str:
    """The text of a preset's file."""
    return yaml_text(preset.model_dump(mode="json"))
