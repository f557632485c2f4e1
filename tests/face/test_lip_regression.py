"""The lips read off the picture of the mouth: drawn mouths whose true opening is known."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.tracking.lip_regression import TUNABLES, LipRegression
from tests.face.faces import SCHEME, SIZE, open_mouth

INNER_LIPS = [*SCHEME.upper_lip_inner, *SCHEME.lower_lip_inner[-2:0:-1]]
OUTER_LIPS = [*SCHEME.upper_lip_outer, *SCHEME.lower_lip_outer[-2:0:-1]]
STILL = HeadPose(rotation_from_angles(0), np.array([0.0, 0.0, -45.0]), 640.0)


def mouth(gap_cm: float, pose: HeadPose = STILL, light: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A picture of skin, lips and what is between them, and its landmarks."""
    landmarks = project(open_mouth(SCHEME, gap_cm), pose, SIZE)
    picture = np.full((SIZE[1], SIZE[0], 3), 170, np.uint8)
    for points, color in ((OUTER_LIPS, (150, 80, 80)), (INNER_LIPS, (50, 20, 20))):
        cv2.fillPoly(picture, [np.round(landmarks[points]).astype(np.int32)], color)
    return (light * cv2.GaussianBlur(picture, (5, 5), 0)).astype(np.uint8), landmarks


def taught(gaps: np.ndarray) -> LipRegression:
    regression = LipRegression(SCHEME)
    for gap in gaps:
        regression.learn(*mouth(gap), STILL)
    return regression


TALK = 0.8 + 0.7 * np.sin(np.arange(24) * 1.1)


@pytest.mark.parametrize("gap", [0.2, 0.7, 1.3])
@pytest.mark.parametrize("yaw", [0.0, 12.0])
def test_it_sees_a_mouth_open_that_flow_holds_still(gap: float, yaw: float) -> None:
    regression = taught(np.append(TALK, 0.9))
    pose = HeadPose(rotation_from_angles(yaw), np.array([1.5, -0.5, -47.0]), 640.0)
    picture, truth = mouth(gap, pose)
    _, held = mouth(0.9, pose)
    corrected = regression.corrected(picture, held, pose)
    wanted = SCHEME.mouth_opening(truth) - SCHEME.mouth_opening(held)
    assert SCHEME.mouth_opening(corrected) - SCHEME.mouth_opening(held) == pytest.approx(
        TUNABLES.weight * wanted, rel=0.3, abs=0.004
    )
    others = np.setdiff1d(np.arange(SCHEME.count), SCHEME.lips)
    np.testing.assert_array_equal(corrected[others], held[others])


def test_dimmer_light_is_no_other_mouth() -> None:
    regression = taught(np.append(TALK, 0.9))
    picture, truth = mouth(0.9, light=0.7)
    corrected = regression.corrected(picture, truth, STILL)
    assert abs(SCHEME.mouth_opening(corrected) - SCHEME.mouth_opening(truth)) < 0.01


def test_before_it_has_learned_enough_the_landmarks_stay() -> None:
    regression = taught(TALK[: TUNABLES.least_frames - 1])
    picture, _ = mouth(1.3)
    _, held = mouth(0.9)
    assert regression.corrected(picture, held, STILL) is held
    regression.learn(*mouth(0.9), STILL)
    assert regression.corrected(picture, held, STILL) is not held


def test_reset_forgets() -> None:
    regression = taught(TALK)
    regression.reset()
    picture, held = mouth(0.9)
    assert regression.corrected(picture, held, STILL) is held


def test_a_correction_that_is_too_large_is_left_out() -> None:
    regression = taught(np.append(TALK, 0.9))
    picture, held = mouth(0.9)
    strayed = held.copy()
    strayed[list(SCHEME.lips)] += (0.3 * SCHEME.eye_span(held), 0)
    assert regression.corrected(picture, strayed, STILL) is strayed


def test_a_flat_picture_is_no_trouble() -> None:
    regression = LipRegression(SCHEME)
    flat = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    _, landmarks = mouth(0.9)
    for _ in range(TUNABLES.least_frames):
        regression.learn(flat, landmarks, STILL)
    np.testing.assert_allclose(regression.corrected(flat, landmarks, STILL), landmarks, atol=0.01)
