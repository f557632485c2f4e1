"""A picture that is computed in some frames and extrapolated by the head's turn in the others."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.live.modes.scene_relighting import TurnExtrapolation

LIGHT, ROOM = object(), object()
NORMALS = np.random.default_rng(0).normal(size=(64, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)


def shaded(rotation: Rotation) -> np.ndarray:
    """A picture (8, 8, 3) of balls' points under one lamp, as the head turns: it has shadow edges."""
    light = np.maximum(rotation.apply(NORMALS) @ [0.6, 0.48, 0.64], 0)
    return light.reshape(8, 8, 1).repeat(3, axis=2).astype(np.float32)


class Counted:
    """Gives pictures of a turning head, and counts what is computed."""

    def __init__(self, every: int = 2) -> None:
        self.extrapolation, self.every, self.computed = TurnExtrapolation(), every, 0

    def at(self, rotation: Rotation, light: object = LIGHT, room: object = ROOM, scale: float = 1.0) -> np.ndarray:
        def compute() -> np.ndarray:
            self.computed += 1
            return shaded(rotation) * np.float32(scale)

        return self.extrapolation.picture(rotation, light, room, self.every, compute)


def yaw(degrees: float) -> Rotation:
    return rotation_from_angles(degrees, 0.2 * degrees, 0)


@pytest.mark.parametrize(("every", "computed"), [(1, 30), (2, 15), (3, 10)])
def test_it_is_computed_in_every_nth_frame_and_near_the_truth_in_the_others(every: int, computed: int) -> None:
    ours = Counted(every)
    turns = [yaw(8 * np.sin(index / 8)) for index in range(30)]
    pictures = [ours.at(turn) for turn in turns]
    assert abs(ours.computed - computed) <= 2
    error = np.array([np.abs(picture - shaded(turn)).mean() for picture, turn in zip(pictures, turns, strict=True)])
    held = np.array([np.abs(shaded(turns[max(i - 1, 0)]) - shaded(turns[i])).mean() for i in range(30)])
    assert error[every + 1 :].mean() < 0.25 * held.mean()


def test_a_still_head_has_the_same_picture_again_and_nothing_is_computed() -> None:
    ours = Counted()
    for degrees in (0.0, 0.5, 1.0, 1.5, 2.0):
        ours.at(yaw(degrees))
    before, computed = ours.at(yaw(2.0)), ours.computed
    assert all(ours.at(yaw(2.0)) is before for _ in range(10))
    assert ours.computed == computed


def test_a_head_that_stops_or_turns_round_is_not_overshot() -> None:
    for last in (2.0, 2.1, 1.5):
        ours = Counted()
        for degrees in (0.0, 1.0, 2.0, 2.5):  # the last but one is computed
            ours.at(yaw(degrees))
        assert np.abs(ours.at(yaw(last)) - shaded(yaw(last))).max() < 0.02


def test_it_is_never_negative() -> None:
    ours = Counted(every=100)
    ours.extrapolation.picture(yaw(0), LIGHT, ROOM, 100, lambda: np.ones((4, 4, 3), np.float32))
    ours.extrapolation.picture(yaw(1), LIGHT, ROOM, 1, lambda: np.full((4, 4, 3), 0.2, np.float32))
    assert ours.at(yaw(1.9)).min() == 0


def test_another_light_is_computed_at_once_and_does_not_go_on_as_the_last_one_changed() -> None:
    ours = Counted()
    for degrees in (0.0, 0.5, 1.0, 1.5, 2.0):
        ours.at(yaw(degrees))
    other = object()
    np.testing.assert_array_equal(ours.at(yaw(2.0), other, scale=3), 3 * shaded(yaw(2.0)))
    np.testing.assert_array_equal(ours.at(yaw(2.5), other, scale=3), 3 * shaded(yaw(2.0)))  # nothing known yet


def test_a_new_part_is_computed_at_once_and_the_picture_goes_on_changing() -> None:
    ours = Counted(every=3)
    for degrees in (0.0, 0.5, 1.0, 1.5):
        ours.at(yaw(degrees))
    new = object()
    np.testing.assert_allclose(ours.at(yaw(2.0), room=new, scale=1.02), 1.02 * shaded(yaw(2.0)))
    following = ours.at(yaw(2.5), room=new, scale=1.02)
    assert np.abs(following - 1.02 * shaded(yaw(2.5))).max() < 0.01
    assert np.abs(following - 1.02 * shaded(yaw(2.0))).max() > 0


@pytest.mark.parametrize("jump", [(-6.0, 0.0), (1.0, 5.0)])
def test_a_jump_is_computed_at_once(jump: tuple[float, float]) -> None:
    ours = Counted(every=100)
    ours.at(yaw(0.0))
    ours.at(yaw(0.5))
    there = rotation_from_angles(*jump)
    np.testing.assert_array_equal(ours.at(there), shaded(there))


@pytest.mark.parametrize(("max_step_deg", "computed"), [(2.0, 3), (4.0, 2)])
def test_how_far_the_head_may_turn_before_it_is_computed(max_step_deg: float, computed: int) -> None:
    ours = Counted(every=100)
    ours.extrapolation = TurnExtrapolation(np.radians(max_step_deg))
    for degrees in (0.0, 2.5, 4.5):
        ours.at(yaw(degrees))
    assert ours.computed == computed
