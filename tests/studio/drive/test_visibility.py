"""Fractions of a face that can be seen, of squares whose areas are known."""

from __future__ import annotations

import numpy as np
import pytest

from relit_studio.cameras.studio_camera import Camera
from relit_studio.drive.face_visibility import visibility

CAMERA = Camera(180, 320)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def square(middle: tuple[float, float, float], side: float) -> tuple[np.ndarray, np.ndarray]:
    """A square that faces the camera."""
    half = side / 2
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    return corners + middle, TRIANGLES


FACE = square((0, 2.2, 10), 12)
POINTS = np.array([[-4, 2.2, 10], [0, 2.2, 10], [4, 2.2, 10.0]])


def test_a_free_face_is_wholly_visible() -> None:
    seen = visibility(CAMERA, FACE, [], POINTS)
    assert (seen.covered_fraction, seen.visible_fraction) == (0, 1)
    assert not seen.hidden.any()


def test_what_is_before_covers_its_projection_and_what_is_behind_nothing() -> None:
    # Twice as near, half as large: a quarter of the face's picture.
    near = square((0, 2.2, 42), 3)
    seen = visibility(CAMERA, FACE, [near], POINTS)
    assert seen.covered_fraction == pytest.approx(1 / 4, abs=0.02)
    assert seen.visible_fraction == pytest.approx(3 / 4, abs=0.02)
    assert seen.hidden.tolist() == [False, True, False]
    behind = visibility(CAMERA, FACE, [square((0, 2.2, -5), 10)], POINTS)
    assert behind.visible_fraction == 1
    assert not behind.hidden.any()


def test_who_has_left_the_picture_by_half_is_half_visible() -> None:
    edge = CAMERA.distance_cm - 10
    edge *= 160 / CAMERA.focal_px
    shift = np.array([edge, 0, 0])
    seen = visibility(CAMERA, (FACE[0] + shift, TRIANGLES), [], POINTS + shift)
    assert seen.visible_fraction == pytest.approx(0.5, abs=0.02)
    assert seen.covered_fraction == 0
    assert seen.hidden.tolist() == [False, True, True] or seen.hidden.tolist() == [False, False, True]
    gone = visibility(CAMERA, (FACE[0] + 2 * shift, TRIANGLES), [], POINTS + 2 * shift)
    assert gone.visible_fraction == 0
    assert gone.hidden.all()
