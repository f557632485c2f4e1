from dataclasses import dataclass

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, VideoError
from relit_camera.capture.film.face_localization import locate_face, locate_head_by_flash
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid
from relit_camera.capture.film.flash.frame_classification import FrameClass

ROWS, COLUMNS, PIXELS = 32, 24, 22.5


@dataclass(frozen=True)
class Told:
    """What is known of flashes without looking for them."""

    gains: np.ndarray

    @property
    def signal(self):
        return self

    def indices(self, kind):
        return np.flatnonzero(np.arange(60) % 6 < 3 if kind is FrameClass.BRIGHT else np.arange(60) % 6 >= 3)


def seen_with(lit):
    """Sixty frames, every other three of which a flash lights (rows, columns), and its schedule."""
    x = np.arange(60)
    gains = 1 + 0.3 * np.sin(x)
    room = np.random.default_rng(0).uniform(0.02, 0.3, (ROWS, COLUMNS))
    strength = (x % 6 < 3) * (0.7 + 0.3 * np.cos(x / 9))
    cells = (room + strength[:, None, None] * lit) * gains[:, None, None]
    still = np.zeros((256, 192, 3), np.uint8)
    return BrightnessGrid(cells.astype(np.float32), x / 30, (540, 720), still), Told(gains)


def person(hair=0.05):
    """A head of ten cells by thirteen under dark hair, its face about (12, 17), on wide shoulders; a mirror ball."""
    x, y = np.arange(COLUMNS) + 0.5, np.arange(ROWS)[:, None] + 0.5
    lit = np.where(np.hypot((x - 12) / 5, (y - 16.5) / 6.5) < 1, 0.4, 0)
    lit = np.where((lit > 0) & (y < 12.5), hair, lit)
    lit = np.where((y > 24) & (np.abs(x - 12) < 3 + 1.5 * (y - 24)), 0.2, lit)
    lit = np.where((y > 22) & (np.abs(x - 12) < 3), 0.3, lit)
    lit[5:7, 20:22] = 0.35
    return lit


@pytest.mark.parametrize("hair", [0.02, 0.2])
def test_without_a_detector_the_lit_head_is_the_face(hair, tmp_path, monkeypatch):
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path))
    found = locate_face(*seen_with(person(hair)))
    assert found.by == "flash"
    assert abs(found.circle.x - 12 * PIXELS) < 0.3 * 5 * PIXELS
    assert abs(found.circle.y - 17.5 * PIXELS) < 0.4 * 5 * PIXELS
    assert found.circle.radius == pytest.approx(5 * PIXELS, rel=0.15)


def test_with_one_it_is_asked(shared):
    from relit_camera.face.tracking.face_detector import FaceDetector

    with pytest.raises(VideoError, match="no face found"):
        locate_face(*seen_with(person()), FaceDetector(shared / "models" / "face_detection_yunet_2023mar.onnx"))


@pytest.mark.parametrize("width", [1, 24])
def test_what_is_no_head_is_not_taken_for_one(width):
    lit = np.zeros((ROWS, COLUMNS))
    lit[8:30, :width] = 0.5
    with pytest.raises(CaptureError, match="nothing that the flash lights looks like a head; name the face's place"):
        locate_head_by_flash(*seen_with(lit))
