from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relit_camera.base.rotations import angles_from_rotation, rotation_from_angles
from relit_camera.face.head_pose import HeadPose, fit_pose, guess_focal, project, unproject
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme

SIZE = (640, 480)
AHEAD = np.array([0.0, 0.0, -60.0])
NOSE_TIP, RIGHT_EYE, LEFT_EYE = 4, 33, 263


@pytest.fixture(params=("mesh478", "openseeface66"))
def scheme(request: pytest.FixtureRequest) -> LandmarkScheme:
    return landmark_scheme(request.param)


def pose(yaw: float = 0, pitch: float = 0, roll: float = 0, at: np.ndarray = AHEAD, focal: float = 640) -> HeadPose:
    return HeadPose(rotation_from_angles(yaw, pitch, roll), np.asarray(at, float), focal)


def nose_and_eyes(head: HeadPose) -> np.ndarray:
    scheme = landmark_scheme("mesh478")
    return project(scheme.canonical, head, SIZE)[[NOSE_TIP, RIGHT_EYE, LEFT_EYE]]


def test_projection_of_one_worked_point() -> None:
    # 1 cm right, 2 cm up, 50 cm ahead at 500 px: 10 px right of and 20 px above the middle.
    at = project(np.array([[1.0, 2.0, 0.0]]), pose(at=np.array([0, 0, -50.0]), focal=500), SIZE)
    np.testing.assert_allclose(at, [[330, 220]])


def test_yaw_turns_the_nose_to_the_right_of_the_picture() -> None:
    (nose, right, left), (nose_before, *_) = nose_and_eyes(pose(yaw=20)), nose_and_eyes(pose())
    assert nose[0] > nose_before[0] + 10
    assert left[1] == pytest.approx(right[1], abs=3)


def test_pitch_turns_the_nose_down() -> None:
    assert nose_and_eyes(pose(pitch=20))[0, 1] > nose_and_eyes(pose())[0, 1] + 10


def test_roll_lifts_the_right_side_of_the_picture() -> None:
    _, right, left = nose_and_eyes(pose(roll=20))
    assert left[0] > right[0]
    assert left[1] < right[1] - 10


@pytest.mark.parametrize(
    ("yaw", "pitch", "roll"),
    [
        (0, 0, 0),
        (30, 0, 0),
        (-30, 0, 0),
        (0, 25, 0),
        (0, -25, 0),
        (0, 0, 40),
        (0, 0, -40),
        (25, -15, 30),
        (-40, 20, -25),
    ],
)
def test_a_projected_head_gives_its_pose_back(scheme: LandmarkScheme, yaw: float, pitch: float, roll: float):
    truth = pose(yaw, pitch, roll, at=np.array([7.0, -4.0, -55.0]))
    found = fit_pose(project(scheme.canonical, truth, SIZE), scheme, SIZE)
    assert found is not None
    np.testing.assert_allclose(angles_from_rotation(found.rotation), (yaw, pitch, roll), atol=0.01)
    np.testing.assert_allclose(found.translation, truth.translation, atol=0.01)
    assert found.focal_px == 640


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-50, 50),
    st.floats(-35, 35),
    st.floats(-90, 90),
    st.floats(-10, 10),
    st.floats(-8, 8),
    st.floats(-150, -25),
)
def test_any_pose_in_view_comes_back(yaw: float, pitch: float, roll: float, x: float, y: float, z: float):
    scheme = landmark_scheme("mesh478")
    truth = pose(yaw, pitch, roll, at=np.array([x, y, z]))
    found = fit_pose(project(scheme.canonical, truth, SIZE), scheme, SIZE)
    assert found is not None
    assert np.degrees((found.rotation.inv() * truth.rotation).magnitude()) < 0.1


def test_a_given_focal_length_sets_the_distance() -> None:
    scheme = landmark_scheme("mesh478")
    truth = pose(yaw=15, at=np.array([0.0, 0.0, -90.0]), focal=1100)
    found = fit_pose(project(scheme.canonical, truth, SIZE), scheme, SIZE, focal_px=1100)
    assert found is not None
    np.testing.assert_allclose(found.translation, truth.translation, atol=0.02)


def test_noise_on_the_landmarks_hardly_moves_the_pose(scheme: LandmarkScheme):
    truth = pose(10, 5, 0)
    noise = np.random.default_rng(0).normal(0, 0.3, (scheme.count, 2))
    found = fit_pose((project(scheme.canonical, truth, SIZE) + noise).astype(np.float32), scheme, SIZE)
    assert found is not None
    assert np.degrees((found.rotation.inv() * truth.rotation).magnitude()) < 1.0


def test_what_is_no_head_has_no_pose(scheme: LandmarkScheme):
    assert fit_pose(np.full((scheme.count, 2), np.nan, np.float32), scheme, SIZE) is None
    assert fit_pose(np.full((scheme.count, 2), 100.0, np.float32), scheme, SIZE) is None


def test_unproject_undoes_project(scheme: LandmarkScheme):
    head = pose(25, -10, 15, at=np.array([6.0, 3.0, -50.0]))
    points = unproject(project(scheme.canonical, head, SIZE), head, scheme, SIZE)
    np.testing.assert_allclose(points, scheme.canonical, atol=1e-4)


def test_a_moved_landmark_moves_its_point_in_the_picture_plane(scheme: LandmarkScheme):
    head = pose(at=np.array([0.0, 0.0, -60.0]))
    landmarks = project(scheme.canonical, head, SIZE)
    moved = landmarks + np.array([3.2, -3.2], np.float32)
    change = unproject(moved, head, scheme, SIZE) - unproject(landmarks, head, scheme, SIZE)
    depth = 60 - scheme.canonical[:, 2]
    np.testing.assert_allclose(change, np.stack([3.2 * depth / 640, 3.2 * depth / 640, 0 * depth], 1), atol=1e-4)


def test_the_guessed_focal_length_is_the_longer_side() -> None:
    assert guess_focal((640, 480)) == guess_focal((480, 640)) == 640.0
