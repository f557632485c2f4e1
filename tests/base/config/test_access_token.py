"""The token: from the environment or a file, never said, and asked for where other machines can reach the server."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from relit_camera.base.config.access_token import read_token
from relit_camera.base.config.settings import ServerSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.base.errors import ConfigError
from tests.cli.relit_command import call

TOKEN = "correct-horse-battery-staple"


@pytest.fixture
def token_file(tmp_path: Path) -> Path:
    path = tmp_path / "token"
    path.write_text(f"{TOKEN}\n")
    path.chmod(0o600)
    return path


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No configuration of the developer's counts."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    for name in [name for name in os.environ if name.startswith("RELIT_")]:
        monkeypatch.delenv(name)


def test_none_is_asked_for_on_loopback() -> None:
    for host in ("127.0.0.1", "127.0.0.2", "::1", "localhost"):
        assert read_token(ServerSettings(host=host)) is None


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "fe80::1", "camera.lan", "127.0.0.1.nip.example", ""])
def test_other_addresses_need_one(host: str) -> None:
    with pytest.raises(ConfigError, match="there is no token") as caught:
        read_token(ServerSettings(host=host))
    assert "openssl rand" in caught.value.cure


def test_it_comes_from_a_file(token_file: Path) -> None:
    assert read_token(ServerSettings(host="0.0.0.0", token_file=token_file)) == TOKEN.encode()


def test_it_comes_from_the_environment_which_outranks_the_file(
    token_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_SERVER__TOKEN", "another-token-of-some-length")
    monkeypatch.setenv("RELIT_SERVER__TOKEN_FILE", str(token_file))
    assert read_token(load_settings().server) == b"another-token-of-some-length"


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o620])
def test_a_file_that_others_may_read_is_refused(token_file: Path, mode: int) -> None:
    token_file.chmod(mode)
    with pytest.raises(ConfigError, match="other users") as caught:
        read_token(ServerSettings(token_file=token_file))
    assert f"chmod 600 '{token_file}'" in caught.value.cure
    assert stat.S_IMODE(token_file.stat().st_mode) == mode


@pytest.mark.parametrize("text", ["", "\n", "short", "fifteen-letters", "two words of one", "zu kürzer als gedacht"])
def test_a_token_that_is_none_is_refused_and_not_said(token_file: Path, text: str) -> None:
    token_file.write_text(text)
    with pytest.raises(ConfigError, match="the token in") as caught:
        read_token(ServerSettings(token_file=token_file))
    assert not text.strip() or text not in str(caught.value)
    assert "openssl rand" in caught.value.cure


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no-such"):
        read_token(ServerSettings(token_file=tmp_path / "no-such"))


def test_it_is_shown_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_SERVER__TOKEN", TOKEN)
    settings = load_settings()
    assert TOKEN not in f"{settings!r} {settings.model_dump()} {settings.model_dump_json()}"
    for command in (["config", "show"], ["config", "schema"], ["config", "check"]):
        answer = call(*command)
        assert answer.code == 0
        assert TOKEN not in answer.out + answer.err


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("RELIT_SERVER__TOKN", TOKEN),
        ("RELIT_SERVER__TOKEN__X", TOKEN),
        ("RELIT_SERVER", f'{{"token": ["{TOKEN}"]}}'),
        ("RELIT_SERVER", f'{{"token": "{TOKEN}'),
        ("RELIT_SERVER", f'{{"tokn": "{TOKEN}"}}'),
        ("RELIT_TOKEN", TOKEN),
        ("RELIT_SERVER__TOKEN", TOKEN[:10]),
    ],
)
def test_a_mistake_does_not_tell_it(monkeypatch: pytest.MonkeyPatch, variable: str, value: str) -> None:
    monkeypatch.setenv(variable, value)
    answer = call("config", "check")
    answer.complains()
    assert TOKEN[:10] not in answer.err


def test_it_does_not_belong_beside_the_settings(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(f"server:\n  token: {TOKEN}\n")
    answer = call("--config", path, "config", "check")
    answer.complains("server.token_file")
    assert TOKEN not in answer.err


def test_there_is_no_option_for_it() -> None:
    """Every user of the machine can see a command line."""
    answer = call("run", "--help")
    assert "--host" in answer.out
    assert "--token" not in answer.out


def test_the_camera_refuses_to_start_without_one() -> None:
    call("run", "--source", "pattern", "--sink", "null", "--host", "0.0.0.0", "--port", "0").complains(
        "'0.0.0.0' can be reached from other machines", "openssl rand"
    )


@pytest.mark.parametrize("name", ["http://camera.lan", "camera.lan/x", "a b", "user@host", "Camera.lan", "x:y", ""])
def test_names_are_names(name: str) -> None:
    with pytest.raises(ValueError, match="names"):
        ServerSettings(names=(name,))
