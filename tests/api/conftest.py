"""A fake camera, the application around it, and a client."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi import FastAPI

from relit_camera.api.app import create_app
from relit_camera.api.server.http_server import ApiServer, start_api_server
from relit_camera.base.config.settings import RelitSettings, ServerSettings, StorageSettings
from tests.api.api_client import Client
from tests.api.fake_camera import FakeCamera


@pytest.fixture
def camera(tmp_path: Path) -> Iterator[FakeCamera]:
    camera = FakeCamera(tmp_path / "data")
    yield camera
    camera.stop()


@pytest.fixture
def settings(tmp_path: Path) -> RelitSettings:
    return RelitSettings(storage=StorageSettings(data_dir=tmp_path / "data"))


@pytest.fixture
def app(camera: FakeCamera, settings: RelitSettings) -> FastAPI:
    return create_app(camera, settings)


@pytest.fixture
def client(app: FastAPI) -> Client:
    return Client(app)


@pytest.fixture
def server(app: FastAPI) -> Iterator[ApiServer]:
    with start_api_server(app, ServerSettings(port=0)) as server:
        yield server
