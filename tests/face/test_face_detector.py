from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import ModelError
from relit_camera.face.detection.face_detector import intersection_over_union, is_same_face
from relit_camera.face.detection.yunet_detector import YuNetDetector


def test_overlap_is_intersection_over_union() -> None:
    assert intersection_over_union((0, 0, 10, 10), (0, 0, 10, 10)) == 1
    assert intersection_over_union((0, 0, 10, 10), (5, 0, 10, 10)) == pytest.approx(1 / 3)
    assert intersection_over_union((0, 0, 10, 10), (20, 0, 10, 10)) == 0
    assert intersection_over_union((0, 0, 0, 0), (0, 0, 0, 0)) == 0


def test_a_face_that_moved_a_little_is_the_same() -> None:
    assert is_same_face((0, 0, 10, 10), (3, 3, 11, 11))
    assert not is_same_face((0, 0, 10, 10), (9, 9, 10, 10))


def test_a_missing_model_names_its_cure(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="relit models pull"):
        YuNetDetector(tmp_path / "none.onnx")


def test_a_damaged_model_names_its_cure(tmp_path: Path) -> None:
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no model at all")
    with pytest.raises(ModelError, match=r"broken\.onnx is damaged"):
        YuNetDetector(broken)


@pytest.mark.parametrize("size", [(1, 1), (3, 500), (500, 3), (64, 48)])
def test_pictures_of_any_size_are_searched(face_models: Path, size: tuple[int, int]) -> None:
    detector = YuNetDetector(face_models / "face_detector_yunet.onnx")
    assert detector.detect(np.full((size[1], size[0], 3), 90, np.uint8)) is None


def test_the_face_near_the_last_one_is_preferred_to_the_larger(face_models: Path, portrait: np.ndarray) -> None:
    height, width = portrait.shape[:2]
    small = portrait[::2, ::2]
    both = np.zeros((height, width + small.shape[1], 3), np.uint8)
    both[:, :width] = portrait
    both[: small.shape[0], width:] = small
    detector = YuNetDetector(face_models / "face_detector_yunet.onnx")
    largest = detector.detect(both)
    assert largest is not None
    assert largest.box[0] + largest.box[2] / 2 < width
    x, y, box_width, box_height = largest.box
    near_small = (width + x / 2, y / 2, box_width / 2, box_height / 2)
    followed = detector.detect(both, near=near_small)
    assert followed is not None
    assert followed.box[0] > width
    assert followed.box[2] == pytest.approx(box_width / 2, rel=0.2)
    assert followed.eyes[0, 0] < followed.eyes[1, 0]  # the subject's right eye is at the picture's left


def test_a_look_nearby_finds_the_same_face_and_no_other(face_models: Path, portrait: np.ndarray) -> None:
    height, width = portrait.shape[:2]
    both = np.zeros((2 * height, 3 * width, 3), np.uint8)
    both[:height, :width] = portrait
    detector = YuNetDetector(face_models / "face_detector_yunet.onnx")
    whole = detector.detect(both)
    assert whole is not None
    nearby = detector.detect_nearby(both, whole.box)
    assert nearby is not None
    assert intersection_over_union(nearby.box, whole.box) > 0.7
    span = np.linalg.norm(whole.eyes[0] - whole.eyes[1])
    assert np.linalg.norm(nearby.eyes - whole.eyes, axis=1).max() < 0.15 * span
    x, y, box_width, box_height = whole.box
    assert detector.detect_nearby(both, (x + 2 * width, y + height, box_width, box_height)) is None
    assert detector.detect_nearby(both, (10 * width, y, box_width, box_height)) is None
