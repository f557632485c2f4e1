from __future__ import annotations

import math

import numpy as np
import pytest

from relit_camera.base.rotations import Rotation, angles_from_rotation, rotation_from_angles
from relit_camera.face.motion.one_euro_filter import OneEuroFilter, OneEuroParameters, RotationOneEuroFilter

RATE = 30.0


class ReferenceOneEuro:
    """The scalar filter as its paper prints it (Casiez et al. 2012, algorithm 1), without a dead band."""

    def __init__(self, min_cutoff: float, beta: float, speed_cutoff: float) -> None:
        self.min_cutoff, self.beta, self.speed_cutoff = min_cutoff, beta, speed_cutoff
        self.value = self.filtered = self.speed = None

    @staticmethod
    def alpha(cutoff: float) -> float:
        tau = 1 / (2 * math.pi * cutoff)
        return 1 / (1 + tau * RATE)

    def __call__(self, value: float) -> float:
        if self.value is None:
            self.value = self.filtered = value
            return value
        speed = (value - self.value) * RATE
        known = speed if self.speed is None else self.speed
        self.speed = known + self.alpha(self.speed_cutoff) * (speed - known)
        alpha = self.alpha(self.min_cutoff + self.beta * abs(self.speed))
        self.filtered += alpha * (value - self.filtered)
        self.value = value
        return self.filtered


def test_it_is_the_filter_of_the_paper() -> None:
    values = np.cumsum(np.random.default_rng(3).normal(0, 1, 80))
    reference = ReferenceOneEuro(1.2, 0.3, 0.8)
    ours = OneEuroFilter(OneEuroParameters(min_cutoff_hz=1.2, beta=0.3, speed_cutoff_hz=0.8))
    for index, value in enumerate(values):
        got = ours(np.array([value]), index / RATE)
        assert got[0] == pytest.approx(reference(value), abs=1e-9)


def test_a_constant_passes_unchanged() -> None:
    smooth = OneEuroFilter(OneEuroParameters(min_cutoff_hz=1.0, beta=0.1))
    for index in range(5):
        np.testing.assert_allclose(smooth(np.array([[1.0, 2.0]]), index / RATE), [[1, 2]])


def test_a_quick_move_is_followed_quicker_than_a_slow_one() -> None:
    def lag(speed: float) -> float:
        smooth = OneEuroFilter(OneEuroParameters(min_cutoff_hz=1.0, beta=0.5))
        for index in range(60):
            value = np.array([speed * index / RATE])
            late = (value - smooth(value, index / RATE))[0]
        return late / speed

    assert lag(20.0) < lag(1.0) / 4


def test_a_vector_is_filtered_alike_in_every_direction() -> None:
    settings = OneEuroParameters(min_cutoff_hz=1.0, beta=0.5, dead_band=0.1)
    along, across = OneEuroFilter(settings), OneEuroFilter(settings)
    turn = rotation_from_angles(30, 20, 10)
    for index, step in enumerate(np.random.default_rng(1).normal(0, 1, (40, 3))):
        time_s = index / RATE
        np.testing.assert_allclose(turn.apply(along(step, time_s)), across(turn.apply(step), time_s), atol=1e-9)


def test_each_vector_has_its_own_settings() -> None:
    cutoffs = np.array([[1.0], [8.0]])
    both = OneEuroFilter(OneEuroParameters(min_cutoff_hz=cutoffs))
    for index, value in enumerate(np.random.default_rng(2).normal(0, 1, 20)):
        out = both(np.array([[value], [value]]), index / RATE)
    alone = OneEuroFilter(OneEuroParameters(min_cutoff_hz=8.0))
    for index, value in enumerate(np.random.default_rng(2).normal(0, 1, 20)):
        expected = alone(np.array([[value]]), index / RATE)
    assert out[1] == pytest.approx(expected[0])
    assert out[0] != pytest.approx(expected[0])


def test_within_the_dead_band_the_output_is_exactly_still() -> None:
    smooth = OneEuroFilter(OneEuroParameters(min_cutoff_hz=2.0, beta=0.1, dead_band=0.5))
    noise = np.random.default_rng(5).normal(0, 0.1, (300, 4, 2))
    outputs = [smooth(step, index / RATE) for index, step in enumerate(noise)]
    assert all(np.array_equal(output, outputs[0]) for output in outputs)


def test_leaving_the_dead_band_makes_no_step() -> None:
    band = 0.5
    banded = OneEuroFilter(OneEuroParameters(min_cutoff_hz=1000.0, dead_band=band))
    outputs = np.array([banded(np.array([0.01 * index]), index / RATE)[0] for index in range(400)])
    steps = np.diff(outputs)
    assert outputs[49] == 0  # the input has moved by 0.49
    assert steps.max() < 0.02  # twice the input's own step, not the band
    assert (steps >= 0).all()
    assert outputs[-1] == pytest.approx(3.99, abs=1.1 * band)


def test_a_fast_move_leaves_the_dead_band_behind() -> None:
    banded = OneEuroFilter(OneEuroParameters(min_cutoff_hz=1000.0, dead_band=0.5))
    banded(np.array([0.0]), 0.0)
    assert banded(np.array([10.0]), 1 / RATE)[0] == pytest.approx(10, abs=0.1)


def test_noise_widens_the_dead_band() -> None:
    smooth = OneEuroFilter(OneEuroParameters(min_cutoff_hz=1000.0, dead_band=0.1))
    smooth(np.zeros((2, 1)), 0.0, noise=5.0)
    moved = smooth(np.full((2, 1), 0.4), 0.1, noise=np.array([[5.0], [1.0]]))
    assert moved[0, 0] == 0
    assert moved[1, 0] == pytest.approx(0.4, abs=0.01)


def test_time_that_stands_still_changes_nothing_and_time_that_goes_back_begins_anew() -> None:
    smooth = OneEuroFilter(OneEuroParameters(min_cutoff_hz=1.0))
    smooth(np.array([0.0]), 1.0)
    assert smooth(np.array([5.0]), 1.0)[0] == 0
    assert smooth(np.array([7.0]), 0.0)[0] == 7


def test_reset_forgets() -> None:
    smooth = OneEuroFilter(OneEuroParameters(min_cutoff_hz=0.1))
    smooth(np.array([0.0]), 0.0)
    smooth.reset()
    assert smooth(np.array([9.0]), 0.1)[0] == 9


def turned_by(smooth: RotationOneEuroFilter, angles: list[float], time_s: float) -> Rotation:
    return Rotation(smooth(rotation_from_angles(*angles).as_matrix(), time_s))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_about_one_axis_is_filtered_as_its_angle(axis: int):
    settings = OneEuroParameters(min_cutoff_hz=1.5, beta=0.2, dead_band=0.3)
    turns, numbers = RotationOneEuroFilter(settings), OneEuroFilter(settings)
    for index, angle in enumerate(np.cumsum(np.random.default_rng(7).normal(0, 1.0, 60))):
        angles = [0.0, 0.0, 0.0]
        angles[axis] = angle
        turned = angles_from_rotation(turned_by(turns, angles, index / RATE))
        assert turned[axis] == pytest.approx(numbers(np.array([angle]), index / RATE)[0], abs=1e-6)


def test_a_turn_goes_the_short_way() -> None:
    smooth = RotationOneEuroFilter(OneEuroParameters(min_cutoff_hz=1.0))
    turned_by(smooth, [179], 0.0)
    assert abs(angles_from_rotation(turned_by(smooth, [-179], 1 / RATE)).yaw) > 178.9
