"""Named looks in the user's data folder: one YAML file each."""

from __future__ import annotations

from pathlib import Path

import yaml
from pydantic import ValidationError

from relit_camera.base.config.look import Look
from relit_camera.base.config.safe_yaml import MAX_YAML_BYTES, parse_yaml
from relit_camera.base.errors import InputError
from relit_camera.base.storage.named_files import NamedFiles

PRESET_SUFFIX = ".yaml"


class PresetStore(NamedFiles):
    """A folder of YAML files, each a whole `Look`; a preset's name is its file's stem."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, "preset", [PRESET_SUFFIX])

    def load(self, name: str) -> Look:
        """Read a preset.

        Raises:
            NotFoundError: there is none of that name.
            InputError: the file is not a valid look: a person edited it, or another version wrote it.
        """
        path = self.path(name)
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
            InputError: the name is not allowed.
            StorageError: it cannot be written.
        """
        is_new = name not in self.names()
        self.write(
            name, PRESET_SUFFIX, yaml.safe_dump(look.model_dump(mode="json"), sort_keys=False, allow_unicode=True)
        )
        return is_new
