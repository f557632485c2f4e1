"""Fixtures of the tests that use real networks and pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.base.models.model_store import FOLDER_VARIABLE, ModelStore
from tests.made_once import made_once
from tests.package_index import packaged_models
from tests.replay.materials import UnavailableError, shared_folder

MODELS = ("face_mesh", "face_detector_yunet", "selfie_landscape", "selfie_square")


@pytest.fixture(scope="session")
def pulled_models() -> Path:
    """A folder with the networks that a capture needs: those of the shared data, else those of the package index."""
    try:
        mirror = shared_folder() / "models"
    except UnavailableError:
        return packaged_models()
    return made_once("mirrored-models", lambda folder: ModelStore(folder).pull(MODELS, mirror=mirror))


@pytest.fixture
def models(pulled_models: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """That folder, made the one that networks are looked for in."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(pulled_models))
    return pulled_models
