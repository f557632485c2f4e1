"""The scene that a run begins with, shown in a thread of its own."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from relit_camera.app.first_scene import FirstScene
from relit_camera.base.config.settings import RelitSettings, StorageSettings
from relit_camera.base.errors import NotFoundError
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.environments.environment_store import EnvironmentStore


def settings_in(folder: Path) -> RelitSettings:
    return RelitSettings(storage=StorageSettings(data_dir=folder))


def test_it_goes_on_while_others_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    goes_on, load = threading.Event(), EnvironmentStore.load

    def load_later(store: EnvironmentStore, name: str) -> Environment:
        goes_on.wait(60)
        return load(store, name)

    monkeypatch.setattr(EnvironmentStore, "load", load_later)
    first_scene = FirstScene(settings_in(tmp_path))
    goes_on.set()  # its thread waits for this one
    environment = first_scene.controller().scene.environment
    assert environment is not None
    assert environment.name == "studio"


def test_what_cannot_be_shown_is_told_to_whoever_asks_for_it(tmp_path: Path) -> None:
    first_scene = FirstScene(settings_in(tmp_path), environment="nowhere")
    with pytest.raises(NotFoundError, match="nowhere"):
        first_scene.controller()
