"""`relit config` as a person runs it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import load_settings
from tests.cli.relit_command import call


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder without a configuration file."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    return folder


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.yaml"
    path.write_text(text)
    return path


def shown(*arguments: object) -> Any:
    answer = call(*arguments, "config", "show")
    assert answer.code == 0, answer
    return yaml.safe_load(answer.out)


def test_check_says_which_file_is_right(elsewhere: Path) -> None:
    answer = call("config", "check", write(elsewhere, "server:\n  port: 9000\n"))
    assert (answer.code, answer.out) == (0, f"{elsewhere / 'mine.yaml'} is right\n")
    assert call("config", "check").out == "there is no configuration file: the defaults hold\n"


def test_check_takes_the_global_option_too(elsewhere: Path) -> None:
    path = write(elsewhere, "server:\n  port: 9000000\n")
    call("--config", path, "config", "check").complains("mine.yaml line 2", "server.port", "9000000")


def test_check_names_file_line_key_and_value(elsewhere: Path) -> None:
    path = write(elsewhere, "output:\n  sink: camera\n  with: 640\n")
    call("config", "check", path).complains(f"{path} line 3", "output.with", "640", "relit config schema")


def test_a_missing_file_and_broken_yaml_are_one_line(elsewhere: Path) -> None:
    call("config", "check", elsewhere / "none.yaml").complains("no configuration file", "none.yaml")
    call("config", "check", write(elsewhere, "server: [\n")).complains("mine.yaml line", "correct the YAML")


def test_an_unknown_variable_is_refused_and_the_models_folder_is_none(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(elsewhere))
    assert call("config", "check").code == 0
    monkeypatch.setenv("RELIT_PRT", "3")
    call("config", "check").complains("RELIT_PRT", "is no setting")


def test_show_is_what_holds_after_file_environment_options(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(elsewhere, "server:\n  port: 1000\nlog_level: error\noutput:\n  width: 640\n")
    monkeypatch.setenv("RELIT_SERVER__PORT", "2000")
    settings = shown("--config", path, "--log-level", "debug")
    assert settings["server"] == {"host": "127.0.0.1", "port": 2000, "token_file": None, "names": []}
    assert settings["log_level"] == "debug"
    assert settings["output"]["width"] == 640
    assert settings["output"]["height"] == 720


def test_what_show_prints_is_a_configuration_file(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(elsewhere, "look:\n  lighting:\n    lamps:\n      - kelvin: 3000\n  background:\n    kind: blur\n")
    answer = call("--config", path, "config", "show")
    again = elsewhere / "again.yaml"
    again.write_text(answer.out)
    monkeypatch.delenv("RELIT_STORAGE__DATA_DIR")
    assert load_settings(again).look == load_settings(path).look
    assert call("config", "check", again).code == 0


def test_schema_has_every_key_with_range_and_default() -> None:
    schema = json.loads(call("config", "schema").out)
    assert set(schema["properties"]) == set(RelitSettings.model_fields)
    assert schema["additionalProperties"] is False
    server = schema["$defs"]["ServerSettings"]["properties"]
    assert server["port"]["maximum"] == 65535
    assert server["port"]["default"] == 8470
    for name, definition in schema["$defs"].items():
        assert definition.get("description") or "enum" in definition, f"{name} does not say what it is"
