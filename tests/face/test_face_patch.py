from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.face.tracking.landmark_tracker import FacePatch

SIZE = 200
POINTS = np.array([[60, 50], [140, 150]], np.float32)


def scene(shift: float = 0.0, gain: float = 1.0, seed: int = 0) -> np.ndarray:
    """Blotches as large as a face's parts, moved to the right by `shift` pixels."""
    noise = np.random.default_rng(seed).normal(0, 1, (SIZE, SIZE, 3)).astype(np.float32)
    blotches = cv2.GaussianBlur(noise, (0, 0), 10)
    blotches = 110 + 60 * blotches / blotches.std()
    moved = cv2.warpAffine(blotches, np.array([[1, 0, shift], [0, 1, 0]]), (SIZE, SIZE), borderMode=cv2.BORDER_REFLECT)
    return np.clip(moved * gain, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("change", [{"shift": 2.0}, {"gain": 0.6}, {"gain": 1.2}])
def test_small_motion_and_other_exposure_are_no_cut(change: dict[str, float]) -> None:
    assert FacePatch(scene(), POINTS).matches(scene(**change))


@pytest.mark.parametrize("change", [{"shift": 30.0}, {"seed": 1}])
def test_a_jump_or_another_picture_is_a_cut(change: dict[str, float]) -> None:
    assert not FacePatch(scene(), POINTS).matches(scene(**change))  # type: ignore[arg-type]


def test_only_the_faces_place_counts() -> None:
    other = scene(seed=1)
    other[40:160, 50:150] = scene()[40:160, 50:150]
    assert FacePatch(scene(), POINTS).matches(other)


def test_a_flat_picture_and_points_in_one_place_are_no_trouble() -> None:
    flat = np.full((SIZE, SIZE, 3), 90, np.uint8)
    assert FacePatch(flat, POINTS).matches(flat)
    assert FacePatch(scene(), np.zeros((5, 2), np.float32)).matches(scene())


@pytest.mark.parametrize("corner", [-400, -50, 150, 900])
def test_a_face_that_is_partly_or_wholly_beyond_the_picture_is_compared_where_it_is_inside(corner: int) -> None:
    points = np.array([[corner, corner], [corner + 100, corner + 100]], np.float32)
    assert FacePatch(scene(), points).matches(scene())


def test_it_keeps_the_points() -> None:
    assert FacePatch(scene(), POINTS).points is POINTS
