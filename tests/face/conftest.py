"""Fixtures of the face tests that use real networks and pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.models.model_store import FOLDER_VARIABLE, ModelStore

FACE_MODELS = ("face_mesh", "face_blendshapes", "face_detector_yunet", "face_detector_short_range", "openseeface")


@pytest.fixture(scope="session")
def pulled_face_models(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the face models, converted from the local mirror."""
    folder = tmp_path_factory.mktemp("models")
    ModelStore(folder).pull(FACE_MODELS, mirror=shared / "models")
    return folder


@pytest.fixture
def face_models(pulled_face_models: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The face models' folder, made the one that trackers look in."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(pulled_face_models))
    return pulled_face_models


@pytest.fixture(scope="session")
def portrait(shared: Path) -> np.ndarray:
    """A photograph of one face, RGB uint8."""
    image = cv2.imread(str(shared / "portraits" / "astronaut.png"), cv2.IMREAD_COLOR)
    assert image is not None
    return np.ascontiguousarray(image[..., ::-1])
