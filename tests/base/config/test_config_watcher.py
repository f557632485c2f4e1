"""Edits of the configuration while the camera runs: what is taken, and what is kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.base.config.config_watcher import ConfigWatcher
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.base.errors import ConfigError, RelitError

WAIT_S = 60.0


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "mine.yaml"
    path.write_text("log_level: info", encoding="utf-8")
    return path


def test_edits_are_reported_once_and_in_order(path: Path) -> None:
    applied: list[tuple[str, str]] = []
    reported: list[Exception | None] = []

    def apply(before: RelitSettings, after: RelitSettings) -> RelitError | None:
        if after.log_level == "error":
            raise ConfigError("refused", "no cure")
        applied.append((before.log_level, after.log_level))
        return ConfigError("noted", "no cure") if after.log_level == "warning" else None

    watcher = ConfigWatcher(path, load_settings, load_settings(path), apply, reported.append)
    for count, text in enumerate(("log_level: [", "log_level: error", "log_level: warning", None, "log_level: debug")):
        path.unlink() if text is None else path.write_text(text, encoding="utf-8")
        for _ in range(5):
            watcher.check()
        assert len(reported) == count + 1
    path.write_text("log_level: info", encoding="utf-8")
    for _ in range(5):
        watcher.check()
    assert applied == [("info", "warning"), ("warning", "debug"), ("debug", "info")]
    assert [str(error) for error in reported[1:3]] == ["refused; no cure", "noted; no cure"]
    assert isinstance(reported[0], ConfigError)
    assert "no configuration file" in str(reported[3])
    assert reported[4:] == [None]


def test_a_file_that_is_being_written_is_waited_for(path: Path) -> None:
    seen: list[str] = []

    def apply(_: RelitSettings, after: RelitSettings) -> None:
        seen.append(after.log_level)

    watcher = ConfigWatcher(path, load_settings, load_settings(path), apply, lambda error: seen.append(str(error)))
    for length in range(30):
        path.write_text("#" * length, encoding="utf-8")
        watcher.check()
    path.write_text("log_level: debug", encoding="utf-8")
    watcher.check()
    assert seen == []
    watcher.check()
    assert seen == ["debug"]
