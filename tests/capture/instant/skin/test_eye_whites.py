"""The whites of the eyes beside the skin under them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.capture.instant.skin.eye_whites import eye_white_ratio
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.skin_prior import skin_luminance_by_eyes
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose

SCHEME = landmark_scheme("mesh478")
SIZE = 256


@pytest.mark.parametrize("white", [0.16, 0.5])
def test_it_is_the_ratio_of_what_was_painted(white: float) -> None:
    points = canonical_landmarks(canonical_pose(SIZE, pixels_per_cm=7.0), SIZE)
    picture = np.full((SIZE, SIZE, 3), 0.2, np.float32)
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        cv2.fillPoly(picture, [np.round(points[list(eye.lids)] - 0.5).astype(np.int32)], (white, white, white))
        x, y = points[eye.iris[0]] - 0.5
        cv2.circle(picture, (round(float(x)), round(float(y))), 4, (0.02, 0.02, 0.02), -1)
    found = eye_white_ratio(picture, points, SCHEME)
    assert found is not None
    assert found == pytest.approx(white / 0.2, rel=0.12)


def test_shut_eyes_tell_nothing() -> None:
    points = canonical_landmarks(canonical_pose(SIZE, pixels_per_cm=7.0), SIZE)
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        points[list(eye.lids), 1] = points[eye.outer, 1]
    assert eye_white_ratio(np.full((SIZE, SIZE, 3), 0.2, np.float32), points, SCHEME) is None


def test_brighter_eye_whites_mean_darker_skin_within_the_limits_of_skin() -> None:
    light, medium, dark = (skin_luminance_by_eyes(ratio) for ratio in (0.9, 1.4, 2.7))
    assert dark < medium < light
    assert light / dark == pytest.approx(3**1.25, rel=1e-3)
    assert skin_luminance_by_eyes(100.0) == skin_luminance_by_eyes(3.0)
    assert dark < skin_luminance_by_eyes(None) < light


@pytest.mark.parametrize(("whites_over_skin", "luminance"), [(1.01, 0.344), (1.35, 0.162), (2.74, 0.077)])
def test_the_level_of_known_people_before_a_screen_is_right_within_half_a_stop(
    whites_over_skin: float, luminance: float
) -> None:
    """Rendered people from light to dark; the one in the middle was not used to choose the level."""
    assert abs(np.log2(skin_luminance_by_eyes(whites_over_skin) / luminance)) < 0.5
