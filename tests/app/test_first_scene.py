"""The scene that a run begins with, shown in a thread of its own."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from relit_camera.app.first_scene import FirstScene
from relit_camera.base.concurrency.decoding_process import DECODING_PROCESS, Decoded
from relit_camera.base.config.settings import RelitSettings, StorageSettings
from relit_camera.base.errors import NotFoundError, NotReadyError
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.environments.environment_store import EnvironmentStore


def decode_long() -> Decoded:
    """A file that takes long; called in the worker process."""
    time.sleep(80)
    return Decoded()


def settings_in(folder: Path) -> RelitSettings:
    return RelitSettings(storage=StorageSettings(data_dir=folder))


def test_it_goes_on_while_others_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    goes_on, load = threading.Event(), EnvironmentStore.load

    def load_later(store: EnvironmentStore, name: str) -> Environment:
        assert goes_on.wait(60)
        return load(store, name)

    monkeypatch.setattr(EnvironmentStore, "load", load_later)
    with FirstScene(settings_in(tmp_path)) as first_scene:
        goes_on.set()  # its thread waits for this one
        environment = first_scene.controller().scene.environment
    assert environment is not None
    assert environment.name == "studio"


def test_a_program_that_ends_waits_for_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, ended = threading.Event(), threading.Event()

    def decode(store: EnvironmentStore, name: str) -> Environment:
        begun.set()
        with pytest.raises(NotReadyError, match="the program stops"):
            DECODING_PROCESS.decode(decode_long)
        ended.set()
        raise NotFoundError("the place was not read")

    monkeypatch.setattr(EnvironmentStore, "load", decode)
    at = time.monotonic()
    with FirstScene(settings_in(tmp_path)):
        assert begun.wait(60)
    assert ended.is_set()
    assert time.monotonic() - at < 60


def test_what_cannot_be_shown_is_told_to_whoever_asks_for_it(tmp_path: Path) -> None:
    told = pytest.raises(NotFoundError, match="nowhere")
    with FirstScene(settings_in(tmp_path), environment="nowhere") as first_scene, told:
        first_scene.controller()
