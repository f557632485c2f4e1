"""Loads the configuration: defaults < YAML file < RELIT_* environment < command line."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from platformdirs import user_config_path
from pydantic import ValidationError
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsError

from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ConfigError
from relit_camera.base.safe_yaml import MAX_YAML_BYTES, parse_yaml

CONFIG_VARIABLE = "RELIT_CONFIG"
NON_SETTING_VARIABLES = frozenset({CONFIG_VARIABLE, "RELIT_MODELS_DIR", "RELIT_SHARED"})
"""Variables with the prefix RELIT_ that are no settings."""

NestedValues = Mapping[str, Any]
_SECTIONS = frozenset(RelitSettings.model_fields) - {"subject"}
"""Keys that are not null."""


def config_path(given: Path | None = None) -> Path | None:
    """The configuration file: `given`, else RELIT_CONFIG, else ./config.yaml, else the user's; None where none is.

    Raises:
        ConfigError: a file was named and is not there.
    """
    named = given or (Path(os.environ[CONFIG_VARIABLE]) if os.environ.get(CONFIG_VARIABLE) else None)
    if named is not None:
        if not named.is_file():
            raise ConfigError(f"no configuration file at {named}", "check the path")
        return named
    usual = (Path("config.yaml"), user_config_path("relit-camera", appauthor=False) / "config.yaml")
    return next((path for path in usual if path.is_file()), None)


def load_settings(path: Path | None = None, overrides: NestedValues | None = None) -> RelitSettings:
    """The configuration of this run.

    Args:
        path: a YAML file; see `config_path` for the usual places.
        overrides: nested values from the command line; None values are no override.

    Raises:
        ConfigError: unreadable YAML, an unknown key, a value out of range; names file, line, key and value.
    """
    found = config_path(path)
    text = _read(found) if found else ""
    try:
        document = parse_yaml(text) or {}
    except ValueError as error:
        raise ConfigError(f"{found}{error}", "correct the YAML") from error
    if not isinstance(document, dict):
        raise ConfigError(f"{found}: expected keys and values, found {type(document).__name__}", "see config.yaml")
    _check_environment()
    _check_no_secret(document, found)
    try:
        # A section whose every line is commented out reads as null: its defaults.
        given = {str(k): v for k, v in document.items() if v is not None or k not in _SECTIONS}
        return _settings_class(given)(**_without_none(overrides or {}))
    except SettingsError as error:  # for a whole section in JSON; its text is not shown, for it may hold the token
        raise ConfigError(f"the environment holds no setting: {error}", "give JSON, or one variable a field") from None
    except ValidationError as error:
        raise _config_error(error, overrides or {}, found, text) from error


def _settings_class(document: NestedValues) -> type[RelitSettings]:
    class Loaded(RelitSettings):
        @classmethod
        def settings_customise_sources(
            cls,
            settings_cls: type[BaseSettings],
            init_settings: PydanticBaseSettingsSource,
            env_settings: PydanticBaseSettingsSource,
            dotenv_settings: PydanticBaseSettingsSource,
            file_secret_settings: PydanticBaseSettingsSource,
        ) -> tuple[PydanticBaseSettingsSource, ...]:
            return init_settings, env_settings, _YamlSource(settings_cls, document)

    return Loaded


class _YamlSource(PydanticBaseSettingsSource):
    """A parsed YAML document as the lowest source."""

    def __init__(self, settings_cls: type[BaseSettings], document: NestedValues) -> None:
        super().__init__(settings_cls)
        self._document = document

    def get_field_value(self, field: object, field_name: str) -> tuple[Any, str, bool]:
        return self._document.get(field_name), field_name, False

    def __call__(self) -> dict[str, Any]:
        return dict(self._document)


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_YAML_BYTES:
            raise ConfigError(f"{path} is larger than {MAX_YAML_BYTES >> 20} MiB", "name a configuration file")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read {path}: {error}", "check the file") from error


def _check_environment() -> None:
    """Refuse misspelled RELIT_* variables, which pydantic-settings would ignore silently."""
    known = set(RelitSettings.model_fields)
    for variable in os.environ:
        if not variable.startswith("RELIT_") or variable in NON_SETTING_VARIABLES:
            continue
        top = variable.removeprefix("RELIT_").split("__")[0].lower()
        if top not in known:
            raise ConfigError(
                f"environment variable {variable} is no setting", f"known are: {', '.join(sorted(known))}"
            )


def _check_no_secret(document: NestedValues, path: Path | None) -> None:
    """Refuse a token among the other settings, which are shown, shared and readable by others."""
    server = document.get("server")
    if isinstance(server, dict) and "token" in server:
        raise ConfigError(
            f"{path}: server.token does not belong here", "put the token into a file of its own: server.token_file"
        )


def _without_none(values: NestedValues) -> dict[str, Any]:
    cleaned = {k: _without_none(v) if isinstance(v, Mapping) else v for k, v in values.items()}
    return {k: v for k, v in cleaned.items() if v is not None and v != {}}


def _config_error(error: ValidationError, overrides: NestedValues, path: Path | None, text: str) -> ConfigError:
    first = error.errors(include_url=False)[0]
    location = [part for part in first["loc"] if not str(part).startswith("function-")]
    key = ".".join(map(str, location))
    message = first["msg"].removeprefix("Value error, ")
    # A value that may be the token is not shown; its key may be misspelled.
    misspelt = first["type"] == "extra_forbidden" and isinstance(first["input"], str)
    secret = location[:1] == ["server"] and (misspelt or "token" in location)
    tells = not secret and not isinstance(first["input"], dict)
    shown = f" (is {first['input']!r:.60})" if tells else ""
    place = _origin_of(location, overrides, path, text, missing=first["type"] == "missing")
    return ConfigError(f"{place}{key}: {message}{shown}", "see 'relit config schema'")


def _origin_of(location: list[Any], overrides: NestedValues, path: Path | None, text: str, missing: bool) -> str:
    """Where the effective value was given: command line, else environment, else a line of the file."""
    given: Any = overrides
    for part in location:
        given = given.get(part) if isinstance(given, Mapping) else None
    if given is not None:
        return "command line: "
    wanted = "RELIT_" + "__".join(map(str, location)).upper()
    variable = next((name for name in os.environ if name.upper() == wanted), None)
    if variable:
        return f"environment variable {variable}: "
    line = _line_of(text, location[:-1] if missing else location)
    return f"{path} line {line}: " if path and line else ""


def _line_of(text: str, location: list[Any]) -> int | None:
    """Line of a key in the YAML text, or None where it is not there."""
    node = yaml.compose(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # which `parse_yaml` has read
    line = None
    for part in location:
        if isinstance(node, yaml.MappingNode):
            found = next(((k, v) for k, v in node.value if k.value == str(part)), None)
            if found is not None:
                line, node = found[0].start_mark.line + 1, found[1]
            elif all(v.value != part for k, v in node.value if k.value == "kind"):
                return None  # else the part is no key: it says which kind of thing the keys after it belong to
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.start_mark.line + 1
    return line
