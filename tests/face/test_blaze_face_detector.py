"""BlazeFace: decoding with a network that says what it is told, and real pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.models.session_with_fallback import open_session
from relit_camera.face.detection.blaze_face_detector import BlazeFaceDetector
from relit_camera.face.detection.face_detector import intersection_over_union
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.detection.yunet_detector import YuNetDetector


class FakeNetwork:
    """Finds faces of 32 px at the anchors of some rows, with these scores; the eyes lie 8 px about the centre."""

    def __init__(self, *scores_of: dict[int, float]) -> None:
        self._scores_of = list(scores_of)
        self.fed: list[np.ndarray] = []

    def run(self, feeds: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        self.fed.append(feeds["image"].copy())
        logits = np.full((1, 896, 1), -50, np.float32)
        for row, score in (self._scores_of.pop(0) if self._scores_of else {}).items():
            logits[0, row] = np.log(score / (1 - score))
        regressors = np.zeros((1, 896, 16), np.float32)
        regressors[..., 2:4] = 32
        regressors[..., 4], regressors[..., 6] = -8, 8
        return {"regressors": regressors, "classificators": logits}


def detector(*scores_of: dict[int, float]) -> tuple[BlazeFaceDetector, FakeNetwork]:
    network = FakeNetwork(*scores_of)
    return BlazeFaceDetector(network), network  # type: ignore[arg-type]


CELL = 2 * (16 * 5 + 8)
"""First anchor of row 5, column 8 of 16: its centre is (68, 44) in 128."""
LATER = 512 + 6 * (8 * 6 + 1)
"""First anchor of row 6, column 1 of 8: its centre is (24, 104)."""


def test_a_row_is_relative_to_its_anchor_and_the_picture_is_letterboxed() -> None:
    found, network = detector({CELL: 0.9})
    picture = np.full((180, 320, 3), 255, np.uint8)
    face = found.detect(picture)
    assert face is not None
    # 320 pixels are 128, so a pixel is 2.5; the picture's 72 rows begin at row 28.
    assert face.box == pytest.approx(((68 - 16) * 2.5, (44 - 28 - 16) * 2.5, 80, 80))
    np.testing.assert_allclose(face.eyes, [[60 * 2.5, 16 * 2.5], [76 * 2.5, 16 * 2.5]])
    assert face.score == pytest.approx(0.9)
    assert network.fed[0].shape == (1, 128, 128, 3)
    np.testing.assert_array_equal(network.fed[0][0, :, 64, 0], [-1] * 28 + [1] * 72 + [-1] * 28)


def test_rows_that_overlap_are_one_face_between_them() -> None:
    face = detector({CELL: 0.9, CELL + 2: 0.9})[0].detect(np.zeros((128, 128, 3), np.uint8))
    assert face is not None
    assert face.box[0] == pytest.approx(68 + 4 - 16)


def test_the_larger_of_two_faces_unless_the_other_is_near() -> None:
    first, _ = detector({CELL: 0.9, LATER: 0.8}, {CELL: 0.9, LATER: 0.8})
    picture = np.zeros((128, 128, 3), np.uint8)
    near = first.detect(picture, near=(8, 88, 32, 32))
    assert near is not None
    assert near.score == pytest.approx(0.8)


def test_what_could_be_a_face_is_looked_at_again() -> None:
    """Its surroundings are 2.5 times its box: 80 px about (68, 44), from (28, 4) on."""
    found, network = detector({CELL: 0.6}, {CELL: 0.9})
    face = found.detect(np.zeros((128, 128, 3), np.uint8))
    assert face is not None
    assert len(network.fed) == 2
    assert face.box[:2] == pytest.approx((28 + (68 - 16) * 80 / 128, 4 + (44 - 16) * 80 / 128))
    assert detector({CELL: 0.6}, {CELL: 0.6})[0].detect(np.zeros((128, 128, 3), np.uint8)) is None


def test_where_nothing_is_found_squares_are_searched() -> None:
    found, network = detector({}, {}, {CELL: 0.9}, {})
    face = found.detect(np.zeros((256, 512, 3), np.uint8))
    assert face is not None
    assert len(network.fed) == 1 + 3
    assert face.box[:2] == pytest.approx((128 + (68 - 16) * 2, (44 - 16) * 2))


@pytest.mark.parametrize("size", [(1, 1), (3, 500), (500, 3), (64, 48)])
def test_pictures_of_any_size_are_searched(face_models: Path, size: tuple[int, int]) -> None:
    assert blaze(face_models).detect(np.full((size[1], size[0], 3), 90, np.uint8)) is None


def blaze(face_models: Path) -> BlazeFaceDetector:
    return BlazeFaceDetector(open_session(face_models / "face_detector_short_range.onnx", "blaze"))


@pytest.mark.parametrize("margin", [0.0, 0.5, 1.0])
def test_near_and_far_faces_lie_where_the_other_detector_sees_them(
    face_models: Path, portrait: np.ndarray, margin: float
) -> None:
    beside = round(margin * portrait.shape[1])
    picture = np.pad(portrait, [(0, 0), (beside, beside), (0, 0)])
    face = blaze(face_models).detect(picture)
    other = YuNetDetector(face_models / "face_detector_yunet.onnx").detect(picture)
    assert face is not None
    assert other is not None
    assert intersection_over_union(face.box, other.box) > 0.4
    span = np.linalg.norm(other.eyes[1] - other.eyes[0])
    # Coarse, but within what the tracker takes for agreement.
    assert np.linalg.norm(face.eyes.mean(axis=0) - other.eyes.mean(axis=0)) < 0.25 * span


def test_the_installed_detector_is_opened(face_models: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert isinstance(open_face_detector(), YuNetDetector)
    only = tmp_path / "only"
    only.mkdir()
    (only / "face_detector_short_range.onnx").symlink_to(face_models / "face_detector_short_range.onnx")
    monkeypatch.setenv("RELIT_MODELS_DIR", str(only))
    assert isinstance(open_face_detector(), BlazeFaceDetector)
