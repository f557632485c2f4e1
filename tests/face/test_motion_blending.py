from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.rotations import angles_from_rotation, rotation_from_angles
from relit_camera.face.motion.motion_blending import (
    Crossfade,
    Inertialization,
    MotionTransition,
    RelativeMotion,
    zero_motion,
)

COUNT = 3


def motion(yaw: float, x: float = 0.0, expression: float = 0.0) -> RelativeMotion:
    return RelativeMotion(rotation_from_angles(yaw), np.array([x, 0, 0]), np.full((COUNT, 3), expression))


def yaw(of: RelativeMotion) -> float:
    return angles_from_rotation(of.rotation).yaw


@pytest.mark.parametrize("kind", [Crossfade, Inertialization])
def test_without_a_change_the_target_passes(kind: type[MotionTransition]):
    ease = kind(0.5)
    target = motion(20, 3, 0.2)
    assert ease(target, "a", 0.0) is target
    assert ease(target, "a", 0.1) is target


@pytest.mark.parametrize("kind", [Crossfade, Inertialization])
def test_a_change_makes_no_jump_and_ends_at_the_new_target(kind: type[MotionTransition]):
    ease = kind(0.5)
    ease(motion(30, 4, 0.5), "a", 0.0)
    begun = ease(motion(-10, -2, 0.1), "b", 0.1)
    assert yaw(begun) == pytest.approx(30)
    assert begun.translation[0] == pytest.approx(4)
    np.testing.assert_allclose(begun.expression, 0.5)
    half = ease(motion(-10, -2, 0.1), "b", 0.35)
    assert yaw(half) == pytest.approx(10)
    assert half.translation[0] == pytest.approx(1)
    np.testing.assert_allclose(half.expression, 0.3)
    assert yaw(ease(motion(-10, -2, 0.1), "b", 0.6)) == pytest.approx(-10)


@pytest.mark.parametrize("kind", [Crossfade, Inertialization])
def test_a_change_amid_a_change_makes_no_jump(kind: type[MotionTransition]):
    ease = kind(0.5)
    ease(motion(30), "a", 0.0)
    ease(motion(0), "b", 0.1)
    before = yaw(ease(motion(0), "b", 0.3))
    assert yaw(ease(motion(40), "c", 0.3)) == pytest.approx(before)


def test_a_crossfade_stays_between_however_fast_the_target_moves() -> None:
    ease = Crossfade(0.5)
    ease(zero_motion(COUNT), "lost", 0.0)
    values = [yaw(ease(motion(-40 + 150 * step / 30), "found", 0.1 + step / 30)) for step in range(16)]
    assert max(values) <= -40 + 150 * 0.5 + 1e-6
    assert min(values) >= -40


def test_an_offset_fade_moves_with_the_target() -> None:
    ease = Inertialization(0.5)
    ease(motion(10), "old", 0.0)
    assert yaw(ease(motion(4), "new", 0.0)) == pytest.approx(10)
    # A target that moves by 8 degrees takes the output along at once.
    assert yaw(ease(motion(12), "new", 0.01)) == pytest.approx(18, abs=0.1)


def test_an_earlier_time_ends_the_easing() -> None:
    ease = Crossfade(0.5)
    ease(motion(30), "a", 5.0)
    ease(motion(0), "b", 5.1)
    assert yaw(ease(motion(0), "b", 1.0)) == pytest.approx(0)
