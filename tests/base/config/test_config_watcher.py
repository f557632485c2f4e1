"""Edits of the configuration while the camera runs: what is taken, and what is kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from relit_camera.base.config import config_watcher
from relit_camera.base.config.config_watcher import watch_config
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.base.errors import ConfigError, RelitError


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config_watcher, "POLL_INTERVAL_S", 0.05)


def wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_edits_are_told_once_and_in_order(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("log_level: info", encoding="utf-8")
    applied: list[tuple[str, str]] = []
    told: list[Exception | None] = []

    def apply(before: RelitSettings, after: RelitSettings) -> RelitError | None:
        if after.log_level == "error":
            raise ConfigError("refused", "no cure")
        applied.append((before.log_level, after.log_level))
        return ConfigError("noted", "no cure") if after.log_level == "warning" else None

    with watch_config(path, load_settings, load_settings(path), apply, told.append):
        path.write_text("log_level: [", encoding="utf-8")
        wait(lambda: len(told) == 1)
        path.write_text("log_level: error", encoding="utf-8")
        wait(lambda: len(told) == 2)
        path.write_text("log_level: warning", encoding="utf-8")
        wait(lambda: len(told) == 3)
        path.unlink()
        wait(lambda: len(told) == 4)
        path.write_text("log_level: debug", encoding="utf-8")
        wait(lambda: len(told) == 5)
        time.sleep(0.3)
    assert applied == [("info", "warning"), ("warning", "debug")]
    assert [str(error) if error else None for error in told[1:3]] == ["refused; no cure", "noted; no cure"]
    assert isinstance(told[0], ConfigError)
    assert "no configuration file" in str(told[3])
    assert told[4] is None


def test_a_file_that_is_being_written_is_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("log_level: info", encoding="utf-8")
    seen: list[str] = []

    def apply(_: RelitSettings, after: RelitSettings) -> None:
        seen.append(after.log_level)

    with watch_config(path, load_settings, load_settings(path), apply, lambda error: seen.append(str(error))):
        for length in range(30):
            path.write_text("#" * length, encoding="utf-8")
            time.sleep(0.02)
        path.write_text("log_level: debug", encoding="utf-8")
        wait(lambda: bool(seen))
    assert seen == ["debug"]
