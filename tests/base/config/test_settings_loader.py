"""Settings come from the right place, and what is wrong with them is said where it is written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import pytest
import yaml

from relit_camera.base.config.look import ANYONE
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import config_path, load_settings
from relit_camera.base.errors import ConfigError


class WriteConfig(Protocol):
    """Writes a configuration file into the test's folder and returns its path."""

    def __call__(self, text: str, name: str = "mine.yaml") -> Path: ...


@pytest.fixture(autouse=True)
def clean(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No variables of ours, no file in the usual places."""
    for name in [name for name in os.environ if name.startswith("RELIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)


@pytest.fixture
def write(tmp_path: Path) -> WriteConfig:
    def write(text: str, name: str = "mine.yaml") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


def values(settings: RelitSettings) -> dict[str, Any]:
    return settings.model_dump()


def test_without_a_file_the_defaults_hold() -> None:
    assert config_path() is None
    assert values(load_settings()) == values(RelitSettings())


@pytest.mark.parametrize("text", ["", "# nothing\n", "server:\n", "server:\n  # port: 9\nmatte:\n", "{}"])
def test_a_file_or_section_without_values_changes_nothing(write: WriteConfig, text: str) -> None:
    assert values(load_settings(write(text))) == values(RelitSettings())


def test_a_subject_of_null_is_nobody(write: WriteConfig) -> None:
    assert load_settings(write("")).subject == ANYONE
    assert load_settings(write("subject: null")).subject is None


def test_the_file_is_found_where_it_is_usual(
    tmp_path: Path, write: WriteConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    user = write("log_level: error\n", "user/relit-camera/config.yaml")
    assert config_path() == user
    here = write("log_level: debug\n", "here/config.yaml")
    found = config_path()
    assert found is not None
    assert found.resolve() == here
    named = write("log_level: warning\n")
    monkeypatch.setenv("RELIT_CONFIG", str(named))
    assert load_settings().log_level == "warning"
    assert config_path(here) == here


def test_yaml_gives_way_to_the_environment_and_that_to_the_command_line(
    write: WriteConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write("server:\n  port: 1000\nlog_level: debug\noutput:\n  fps: 25\n")
    assert load_settings(path).server.port == 1000
    monkeypatch.setenv("RELIT_SERVER__PORT", "2000")
    assert load_settings(path).server.port == 2000
    settings = load_settings(path, {"server": {"port": 3000, "host": None}, "log_level": None})
    assert settings.server.port == 3000
    assert settings.server.host == "127.0.0.1"
    assert settings.log_level == "debug"
    assert settings.output.fps == 25
    assert settings.output.width == 1280


def test_parts_of_one_topic_come_from_all_three_places(write: WriteConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write("output:\n  width: 640\n  height: 480\n  label: Mine\n")
    monkeypatch.setenv("RELIT_OUTPUT__HEIGHT", "360")
    output = load_settings(path, {"output": {"sink": "null"}}).output
    assert (output.width, output.height, output.label, output.sink) == (640, 360, "Mine", "null")


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("log_level: info\nserver:\n  prot: 1\n", 3, ["server.prot", "not permitted", "is 1"]),
        ("output:\n  sink: null\n\n  width: 1281\n", 4, ["output.width", "multiple of 2", "1281"]),
        ("output:\n  fps: .nan\n", 2, ["output.fps", "finite", "nan"]),
        ("server:\n  names: [a, B]\n", 2, ["server.names.1", "pattern", "'B'"]),
        ("log_level: loud\n", 1, ["log_level", "'debug'", "loud"]),
        ("nonsense: 3\n", 1, ["nonsense", "not permitted"]),
        (
            "look:\n  lighting:\n    exposure_ev: 99\n",
            3,
            ["look.lighting.exposure_ev", "less than or equal to 10", "99"],
        ),
        (
            "look:\n  lighting:\n    lamps:\n      - intensity: 1\n      - azimuth_deg: 0\n        kelvin: 900\n",
            6,
            ["look.lighting.lamps.1.kelvin", "1667", "900"],
        ),
        (
            "look:\n  lighting:\n    lamps:\n      - kelvin: 3000\n        color: [1, 1, 1]\n",
            4,
            ["look.lighting.lamps.0", "give kelvin or color, not both"],
        ),
        ("look:\n  background:\n    kind: color\n    color: red\n", 4, ["background", "color", "red"]),
        ("look:\n  background:\n    kind: curtain\n", 2, ["background", "curtain"]),
        ("look:\n  background:\n    kind: blur\n    strength: 9\n", 4, ["background", "strength", "9"]),
        ("look:\n  background:\n    kind: image\n", 2, ["background", "image", "Field required"]),
        ("server: 3\n", 1, ["server", "3"]),
        ("nonsense:\n", 1, ["nonsense", "not permitted"]),
    ],
)
def test_errors_name_file_line_key_and_value(write: WriteConfig, text: str, line: int, words: Sequence[str]) -> None:
    path = write(text)
    with pytest.raises(ConfigError) as error:
        load_settings(path)
    message = str(error.value)
    assert message.startswith(f"{path} line {line}: "), message
    for word in words:
        assert word in message, message
    assert "\n" not in message
    assert error.value.cure


def test_a_wrong_part_of_a_list_that_the_file_has_shorter_is_refused(
    write: WriteConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_SERVER__NAMES", '["a", "B"]')
    with pytest.raises(ConfigError, match=r"server\.names\.1: .*'B'"):
        load_settings(write("server:\n  names: [a]\n"))


def test_broken_yaml_is_said_with_its_line(write: WriteConfig) -> None:
    path = write("server:\n  port: [1\nlog_level: info\n")
    with pytest.raises(ConfigError, match=rf"{path} line [234]: .*; correct the YAML"):
        load_settings(path)


@pytest.mark.parametrize("text", ["- one\n- two\n", "just words\n", "3\n"])
def test_a_file_that_is_no_mapping_is_refused(write: WriteConfig, text: str) -> None:
    with pytest.raises(ConfigError, match="expected keys and values"):
        load_settings(write(text))


def test_a_missing_unreadable_or_binary_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match=r"no configuration file at .*none\.yaml"):
        load_settings(tmp_path / "none.yaml")
    monkeypatch.setenv("RELIT_CONFIG", str(tmp_path / "gone.yaml"))
    with pytest.raises(ConfigError, match=r"gone\.yaml"):
        load_settings()
    monkeypatch.delenv("RELIT_CONFIG")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="cannot read"):
        load_settings(binary)


@pytest.mark.parametrize("text", ["", "server:\n  host: localhost\n", "server:\n  port: 9000\n"])
def test_a_wrong_value_in_the_environment_names_its_variable_and_not_the_file(
    write: WriteConfig, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    path = write(text)
    monkeypatch.setenv("RELIT_SERVER__PORT", "many")
    with pytest.raises(ConfigError, match=r"environment variable RELIT_SERVER__PORT: server\.port: .*many") as error:
        load_settings(path)
    assert path.name not in str(error.value)


def test_a_sink_may_be_called_null_without_quotes(write: WriteConfig) -> None:
    assert load_settings(write("output:\n  sink: null\n")).output.sink == "null"


@pytest.mark.parametrize("name", ["RELIT_PORT", "RELIT_SERVERPORT", "RELIT_X__Y"])
def test_an_unknown_variable_is_refused(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv(name, "1")
    with pytest.raises(ConfigError, match=f"{name} is no setting; known are: .*server"):
        load_settings()


def test_an_unknown_key_below_a_known_one_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_SERVER__PROT", "1")
    with pytest.raises(ConfigError, match=r"server\.prot"):
        load_settings()


def test_variables_that_are_no_settings_are_allowed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path))
    monkeypatch.setenv("RELIT_SHARED", str(tmp_path))
    assert values(load_settings()) == values(RelitSettings())


def test_a_wrong_value_on_the_command_line_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"command line: server\.port: .*70000"):
        load_settings(None, {"server": {"port": 70000}})


def test_settings_cannot_be_changed() -> None:
    settings = load_settings()
    with pytest.raises(ValueError, match="frozen"):
        settings.log_level = "debug"  # type: ignore[misc]  # what the test is about


def test_the_file_in_the_repository_is_right_and_says_the_defaults() -> None:
    """It is where users begin: every key that it names is a key, with the value that holds without it."""
    path = Path(__file__).parents[3] / "config.yaml"
    given = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    assert values(load_settings(path)) == values(RelitSettings())
    assert set(given) <= set(RelitSettings.model_fields)


@pytest.mark.parametrize(("former", "mode"), [("ratio", "live"), ("reenact", "portrait")])
def test_former_names_of_modes_are_read(
    former: str, mode: str, write: WriteConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert load_settings(write(f"look: {{mode: {former}}}")).model_dump(mode="json")["look"]["mode"] == mode
    monkeypatch.setenv("RELIT_LOOK__MODE", former)
    assert str(load_settings().look.mode) == mode


def test_the_former_name_of_a_fallback_is_read(write: WriteConfig) -> None:
    settings = load_settings(write("output: {fallback: live}"))
    assert settings.model_dump(mode="json")["output"]["fallback"] == "filmed"


def test_the_schema_has_the_names_of_today_alone() -> None:
    kinds = RelitSettings.model_json_schema()["$defs"]
    assert (kinds["Mode"]["enum"], kinds["Fallback"]["enum"]) == (["live", "portrait"], ["placeholder", "filmed"])
    assert "`reenact`" in kinds["Mode"]["description"]
