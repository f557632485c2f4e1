"""Named looks in the user's data folder: one YAML file each."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

import yaml
from pydantic import ValidationError

from relit_camera.base.config.look import Look
from relit_camera.base.config.safe_yaml import MAX_YAML_BYTES, parse_yaml
from relit_camera.base.errors import InputError, NotFoundError
from relit_camera.base.storage import make_folder, write_atomic

PRESET_SUFFIX = ".yaml"


class PresetStore:
    """A folder of YAML files, each a whole `Look`; a preset's name is its file's stem.

    Names come checked, as `base.config.look.StoredName`: they cannot leave the folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """Stored names in alphabetical order."""
        return sorted(path.stem for path in self.folder.glob(f"*{PRESET_SUFFIX}") if not path.name.startswith("."))

    def load(self, name: str) -> Look:
        """Read a preset.

        Raises:
            NotFoundError: none of that name.
            InputError: the file is no look any more: a person edited it, or another version wrote it.
        """
        path = self._path(name)
        try:
            if path.stat().st_size > MAX_YAML_BYTES:
                raise ValueError(f"it is larger than {MAX_YAML_BYTES >> 20} MiB")
            return Look.model_validate(parse_yaml(path.read_text(encoding="utf-8")))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            reason = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        except (OSError, ValueError) as error:
            reason = str(error).strip(" :")
        raise InputError(f"preset '{name}' cannot be read: {reason}", "correct its file, or save it again")

    def save(self, name: str, look: Look) -> bool:
        """Write a preset whole or not at all, in place of one of that name. Returns whether it is new.

        Raises:
            StorageError: it cannot be written.
        """
        is_new = name not in self.names()
        make_folder(self.folder)
        text = yaml.safe_dump(look.model_dump(mode="json"), sort_keys=False, allow_unicode=True)
        write_atomic(self.folder / f"{name}{PRESET_SUFFIX}", text)
        return is_new

    def remove(self, name: str) -> None:
        """Delete a preset.

        Raises:
            NotFoundError: none of that name.
        """
        self._path(name).unlink(missing_ok=True)

    def _path(self, name: str) -> Path:
        names = self.names()
        if name not in names:
            close = get_close_matches(name, names, 1)
            cure = f"did you mean '{close[0]}'?" if close else f"stored are: {', '.join(names) or 'none'}"
            raise NotFoundError(f"no preset '{name}'", cure)
        return self.folder / f"{name}{PRESET_SUFFIX}"
