"""The face of a film, by the detector and by what the flash lights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, ModelError, VideoError
from relit_camera.base.images.image_files import read_display
from relit_camera.capture.film.face_localization import (
    find_face_circle,
    locate_face,
    locate_head_by_flash,
    median_eye_distance_px,
)
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass
from relit_camera.face.detection.yunet_detector import YuNetDetector

ROWS, COLUMNS, PIXELS = 32, 24, 22.5


@dataclass(frozen=True)
class StubSignal:
    """The gains of a flash signal."""

    gains: np.ndarray


@dataclass(frozen=True)
class StubFlashes:
    """Flashes of three frames each, every other three."""

    signal: StubSignal

    def indices(self, kind: FrameClass) -> np.ndarray:
        return np.flatnonzero(np.arange(60) % 6 < 3 if kind is FrameClass.BRIGHT else np.arange(60) % 6 >= 3)


def film_of(lit: np.ndarray) -> tuple[BrightnessGrid, Flashes]:
    """Sixty frames, every other three of which a flash lights (rows, columns), and the flashes."""
    x = np.arange(60)
    gains = 1 + 0.3 * np.sin(x)
    room = np.random.default_rng(0).uniform(0.02, 0.3, (ROWS, COLUMNS))
    strength = (x % 6 < 3) * (0.7 + 0.3 * np.cos(x / 9))
    cells = (room + strength[:, None, None] * lit) * gains[:, None, None]
    brightest = np.zeros((256, 192, 3), np.uint8)
    grid = BrightnessGrid(cells.astype(np.float32), x / 30, (540, 720), brightest)
    return grid, cast(Flashes, StubFlashes(StubSignal(gains)))


def person(hair: float = 0.05) -> np.ndarray:
    """A head of ten cells by thirteen under dark hair, its face about (12, 17), on wide shoulders; a mirror ball."""
    x, y = np.arange(COLUMNS) + 0.5, np.arange(ROWS)[:, None] + 0.5
    lit = np.where(np.hypot((x - 12) / 5, (y - 16.5) / 6.5) < 1, 0.4, 0)
    lit = np.where((lit > 0) & (y < 12.5), hair, lit)
    lit = np.where((y > 24) & (np.abs(x - 12) < 3 + 1.5 * (y - 24)), 0.2, lit)
    lit = np.where((y > 22) & (np.abs(x - 12) < 3), 0.3, lit)
    lit[5:7, 20:22] = 0.35
    return lit


@pytest.mark.parametrize("hair", [0.02, 0.2])
def test_without_a_detector_the_lit_head_is_the_face(
    hair: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path))
    found = locate_face(*film_of(person(hair)))
    assert found.by == "flash"
    assert abs(found.circle.x - 12 * PIXELS) < 0.3 * 5 * PIXELS
    assert abs(found.circle.y - 17.5 * PIXELS) < 0.4 * 5 * PIXELS
    assert found.circle.radius == pytest.approx(5 * PIXELS, rel=0.15)


def test_with_a_detector_that_decides(shared: Path) -> None:
    with pytest.raises(VideoError, match="no face found"):
        locate_face(*film_of(person()), YuNetDetector(shared / "models" / "face_detection_yunet_2023mar.onnx"))


@pytest.mark.parametrize("width", [1, 24])
def test_a_shape_that_is_no_head_is_refused(width: int) -> None:
    lit = np.zeros((ROWS, COLUMNS))
    lit[8:30, :width] = 0.5
    with pytest.raises(CaptureError, match="nothing that the flash lights looks like a head; name the face's place"):
        locate_head_by_flash(*film_of(lit))


def test_the_circle_is_that_of_the_face(shared: Path) -> None:
    portrait = read_display(shared / "portraits" / "astronaut.png")
    detector = YuNetDetector(shared / "models" / "face_detection_yunet_2023mar.onnx")
    circle = find_face_circle(portrait, detector)
    assert abs(circle.x - 224) < 15
    assert abs(circle.y - 115) < 25
    assert 40 < circle.radius < 90
    eyes_px = median_eye_distance_px([portrait, np.zeros_like(portrait)], detector)
    assert eyes_px is not None
    assert 0.4 < eyes_px / circle.radius < 1
    assert median_eye_distance_px([np.zeros_like(portrait)], detector) is None
    with pytest.raises(VideoError, match="no face found; show the face upright and whole, or name its place"):
        find_face_circle(np.zeros_like(portrait), detector)


def test_without_a_detector(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path))
    with pytest.raises(ModelError, match=r"the face cannot be looked for.*relit models pull.*or name its place"):
        find_face_circle(np.zeros((90, 90, 3), np.uint8))
