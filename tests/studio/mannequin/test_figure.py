"""Geometry: the mannequin takes the postures it is told to, and its landmarks are where its features are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relit_camera.base.images.color import luminance
from relit_camera.base.rotations import Angles, angles_from_rotation
from relit_camera.face.head_pose import fit_pose, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_studio.mannequin.outputs.olat import landmarks_px
from relit_studio.mannequin.rendering.distant_lights import DistantLights
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View
from relit_studio.mannequin.shape.expression import Expression
from relit_studio.mannequin.shape.figure import Posture, mannequin

SCHEME = landmark_scheme("mesh478")
CAMERA = Camera(256)
RIGHT_IRIS, LEFT_IRIS = 468, 473
NOSE_TIP, CHIN = 4, 152
SOFT = DistantLights(
    np.array([[0.6, 0.2, 0.775], [-0.6, 0.2, 0.775], [0.0, 0.7, 0.714]]), np.full((3, 3), 0.4, dtype=np.float64)
)


def points_of(**kinds: Any) -> np.ndarray:
    return landmarks_px(CAMERA, Posture(**kinds))


def color_at(picture: np.ndarray, point: np.ndarray, radius: float = 1.5) -> np.ndarray:
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] + 0.5
    return np.asarray(picture[np.hypot(x - point[0], y - point[1]) < radius].mean(axis=0))


def rendered_iris(picture: np.ndarray, points: np.ndarray, iris: int) -> np.ndarray:
    """Darkness-weighted center of what is seen within the iris's surroundings."""
    radius = np.linalg.norm(points[iris + 1] - points[iris])
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] + 0.5
    near = np.hypot(x - points[iris, 0], y - points[iris, 1]) < 1.2 * radius
    dark = np.clip(0.12 - luminance(picture), 0, None) * near
    return np.asarray(np.array([(x * dark).sum(), (y * dark).sum()]) / dark.sum())


@pytest.mark.parametrize(
    ("angles", "axis", "sign"),
    [((20, 0, 0), 0, 1), ((-20, 0, 0), 0, -1), ((0, 15, 0), 1, 1), ((0, -15, 0), 1, -1)],
)
def test_yaw_turns_the_nose_right_and_pitch_down(angles: tuple[float, float, float], axis: int, sign: int) -> None:
    neutral, turned = points_of(), points_of(angles=Angles(*angles))
    ears = [127, 356]
    moved = (turned[NOSE_TIP] - turned[ears].mean(axis=0)) - (neutral[NOSE_TIP] - neutral[ears].mean(axis=0))
    assert sign * moved[axis] > 10


def test_roll_lifts_the_pictures_right_side() -> None:
    points = points_of(angles=Angles(0, 0, 10))
    assert points[263, 1] < points[33, 1] - 5
    slope = np.degrees(np.arctan2(points[33, 1] - points[263, 1], points[263, 0] - points[33, 0]))
    assert slope == pytest.approx(10, abs=1)


@pytest.mark.parametrize("angles", [(0, 0, 0), (22, 0, 0), (-15, 10, 0), (12, -8, 14)])
def test_pose_fit_of_the_tracker_recovers_the_posture(angles: tuple[float, float, float]) -> None:
    posture = Posture(Angles(*angles))
    true_pose = CAMERA.head_pose(posture)
    fitted = fit_pose(landmarks_px(CAMERA, posture), SCHEME, (256, 256), CAMERA.focal_px)
    assert fitted is not None
    np.testing.assert_allclose(angles_from_rotation(fitted.rotation), angles, atol=1.5)
    np.testing.assert_allclose(fitted.translation, true_pose.translation, atol=0.7)
    # And the stated pose puts the canonical face over the landmarks without any fit.
    apart = (
        project(SCHEME.canonical[list(SCHEME.rigid)], true_pose, (256, 256))
        - landmarks_px(CAMERA, posture)[list(SCHEME.rigid)]
    )
    assert np.linalg.norm(apart, axis=1).mean() < 1.5


@pytest.mark.parametrize(
    "posture",
    [
        Posture(),
        Posture(Angles(18, 5, -6)),
        Posture(Angles(-18, -5, 6), Expression(gaze_yaw_deg=8)),
        Posture(expression=Expression(gaze_yaw_deg=-14, gaze_pitch_deg=5)),
    ],
)
def test_irises_are_dark_where_their_landmarks_are(posture: Posture) -> None:
    picture = View(posture, CAMERA).under_lights(SOFT)
    points = landmarks_px(CAMERA, posture)
    for iris in (RIGHT_IRIS, LEFT_IRIS):
        span = np.linalg.norm(points[iris + 1] - points[iris])
        assert np.abs(rendered_iris(picture, points, iris) - points[iris])[0] < 0.35 * span
        assert luminance(color_at(picture, points[iris])) < 0.4 * luminance(color_at(picture, points[117], 2))


def test_gaze_moves_the_irises_as_a_head_turns() -> None:
    ahead = points_of()
    aside = points_of(expression=Expression(gaze_yaw_deg=15, gaze_pitch_deg=10))
    irises = slice(468, 478)
    assert (aside[irises] - ahead[irises] > 0.5).all()
    np.testing.assert_array_equal(aside[:468], ahead[:468])


def test_lips_are_red_and_the_open_mouth_is_dark_between_them() -> None:
    picture = View(Posture(), CAMERA).under_lights(SOFT)
    points = points_of()
    lip, cheek = color_at(picture, points[[14, 17]].mean(axis=0)), color_at(picture, points[205])
    assert lip[0] / lip[1] > 1.25 * cheek[0] / cheek[1]
    opened = Posture(expression=Expression(jaw=1))
    inside = landmarks_px(CAMERA, opened)[[13, 14]].mean(axis=0) - [0, -3]
    assert luminance(color_at(View(opened, CAMERA).under_lights(SOFT), inside)) < 0.4 * luminance(lip)


def test_expressions_do_what_they_are_called() -> None:
    neutral = points_of()
    assert min(SCHEME.eyes_opening(neutral)) > 0.25
    assert SCHEME.mouth_opening(neutral) < 0.02
    right, left = SCHEME.eyes_opening(points_of(expression=Expression(blink_right=1)))
    assert right < 0.05
    assert left > 0.25
    assert SCHEME.mouth_opening(points_of(expression=Expression(jaw=1))) > 0.3
    smiling = points_of(expression=Expression(smile=1))
    assert smiling[291, 0] - smiling[61, 0] > 1.15 * (neutral[291, 0] - neutral[61, 0])
    assert smiling[[61, 291], 1].mean() < neutral[[61, 291], 1].mean() - 1
    raised = points_of(expression=Expression(brows=1))
    assert (raised[list(SCHEME.right_brow), 1] < neutral[list(SCHEME.right_brow), 1] - 2).all()
    jaw = points_of(expression=Expression(jaw=0.5)) - neutral
    assert jaw[CHIN, 1] > 6
    assert np.abs(jaw[NOSE_TIP]).max() < 0.2


def test_a_blink_hides_the_eye_behind_skin() -> None:
    points = points_of()
    shut = View(Posture(expression=Expression(blink_right=1)), CAMERA).under_lights(SOFT)
    lid, cheek = color_at(shut, points[RIGHT_IRIS] - [0, 2], 1), color_at(shut, points[117], 2)
    assert luminance(lid) > 0.45 * luminance(cheek)
    assert luminance(color_at(shut, points[LEFT_IRIS])) < 0.4 * luminance(cheek)


def test_the_body_stands_while_the_head_turns() -> None:
    figure = mannequin()
    still, turned = (figure.vertices(Posture(Angles(yaw, 0, 0))) for yaw in (0, 25))
    names = list(figure.parts)
    moved = np.linalg.norm(turned - still, axis=1)
    assert moved[figure.part_of == names.index("pullover")].max() == 0
    assert moved[figure.part_of == names.index("hair")].mean() > 2
    neck = moved[figure.part_of == names.index("neck")]
    assert neck.min() == 0
    assert neck.max() > 1
