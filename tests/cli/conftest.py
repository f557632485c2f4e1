"""Fixtures of the command-line tests."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep the commands' data in a folder of the test."""
    folder = tmp_path / "user-data"
    monkeypatch.setenv("RELIT_STORAGE__DATA_DIR", str(folder))
    return folder
