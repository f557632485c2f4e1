"""Fixtures of the tests that use real networks and pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.base.models.model_store import FOLDER_VARIABLE, ModelStore

MODELS = ("face_mesh", "face_detector_yunet", "selfie_landscape", "selfie_square")


@pytest.fixture(scope="session")
def pulled_models(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the networks that an instant capture needs, converted from the local mirror."""
    folder = tmp_path_factory.mktemp("models")
    ModelStore(folder).pull(MODELS, mirror=shared / "models")
    return folder


@pytest.fixture
def models(pulled_models: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """That folder, made the one that networks are looked for in."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(pulled_models))
    return pulled_models
