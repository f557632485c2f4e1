"""Signs of the angles as design fixes them, and the round trip with scipy as the independent reference."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import transform

from relit_camera.base.rotations import Rotation, angles_from_rotation, rotation_from_angles

NOSE, RIGHT_SIDE, TOP = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def test_yaw_turns_the_nose_to_the_picture_s_right() -> None:
    np.testing.assert_allclose(rotation_from_angles(90).apply(NOSE), (1, 0, 0), atol=1e-12)
    assert rotation_from_angles(10).apply(NOSE)[0] == pytest.approx(np.sin(np.radians(10)))


def test_pitch_turns_the_nose_down() -> None:
    np.testing.assert_allclose(rotation_from_angles(0, 90).apply(NOSE), (0, -1, 0), atol=1e-12)


def test_roll_lifts_the_picture_s_right_side() -> None:
    np.testing.assert_allclose(rotation_from_angles(0, 0, 90).apply(RIGHT_SIDE), TOP, atol=1e-12)


def test_order_is_yaw_of_pitch_of_roll() -> None:
    whole = rotation_from_angles(40, -25, 10)
    parts = rotation_from_angles(40) * rotation_from_angles(0, -25) * rotation_from_angles(0, 0, 10)
    assert (whole.inv() * parts).magnitude() == pytest.approx(0, abs=1e-12)


@given(st.floats(-179, 179), st.floats(-89, 89), st.floats(-179, 179))
def test_round_trip(yaw: float, pitch: float, roll: float) -> None:
    np.testing.assert_allclose(
        angles_from_rotation(rotation_from_angles(yaw, pitch, roll)), (yaw, pitch, roll), atol=1e-6
    )


@given(st.integers(0, 2**32 - 1))
def test_agrees_with_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = transform.Rotation.random(rng=rng), transform.Rotation.random(rng=rng)
    one, other = Rotation(first.as_matrix()), Rotation(second.as_matrix())
    vectors = rng.normal(size=(4, 3))
    np.testing.assert_allclose(angles_from_rotation(one), first.as_euler("YXZ", degrees=True), atol=1e-6)
    np.testing.assert_allclose((one * other.inv()).as_matrix(), (first * second.inv()).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(one.apply(vectors), first.apply(vectors), atol=1e-12)
    np.testing.assert_allclose(one.apply([0, 0, 1]), first.apply([0, 0, 1]), atol=1e-12)
    np.testing.assert_allclose(one.as_rotvec(), first.as_rotvec(), atol=1e-6)
    assert one.magnitude() == pytest.approx(first.magnitude(), abs=1e-6)
    np.testing.assert_allclose(Rotation.from_rotvec(first.as_rotvec()).as_matrix(), first.as_matrix(), atol=1e-12)


def test_the_rotation_nearest_to_a_mean_is_the_mean_rotation() -> None:
    several = transform.Rotation.from_rotvec(np.random.default_rng(4).normal(0, 0.4, (9, 3)))
    mean = Rotation.nearest(several.as_matrix().mean(axis=0))
    np.testing.assert_allclose(mean.as_matrix(), several.mean().as_matrix(), atol=1e-12)
    np.testing.assert_allclose(Rotation.nearest(np.diag([1.0, 1.0, -0.1])).as_matrix(), np.eye(3), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-3, 3.0, np.pi - 2e-3, np.pi - 1e-4])
def test_the_axis_of_the_smallest_and_the_largest_turns_is_known(angle: float) -> None:
    axis = np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(Rotation.from_rotvec(axis * angle).as_rotvec(), axis * angle, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("pitch", [90, -90])
def test_gimbal_lock_gives_angles_of_the_same_rotation_without_a_warning(pitch: float) -> None:
    rotation = rotation_from_angles(30, pitch, 20)
    angles = angles_from_rotation(rotation)
    assert np.isfinite(angles).all()
    assert angles.pitch == pytest.approx(pitch, abs=1e-3)


def test_angles_and_rotations_agree_on_what_stays() -> None:
    assert rotation_from_angles(0, 0, 0).magnitude() == 0
    assert angles_from_rotation(Rotation.identity()) == (0, 0, 0)
