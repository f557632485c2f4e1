"""Easing curves: ease-out, smoothstep, keyframes."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.easing import ease_out_cubic, interpolate_keyframes, smoothstep


def test_a_change_grows_from_nothing_to_all_and_is_fast_at_first() -> None:
    fractions = np.array([ease_out_cubic(time_s, 2.0) for time_s in np.linspace(0, 2, 21)])
    assert fractions[0] == 0
    assert fractions[-1] == 1
    steps = np.diff(fractions)
    assert (steps > 0).all()
    assert (np.diff(steps) < 0).all()


@pytest.mark.parametrize(("elapsed_s", "transition_s"), [(-3.0, 2.0), (2.0, 2.0), (9.0, 2.0), (0.0, 0.0), (0.5, 0.0)])
def test_before_its_beginning_and_after_its_end_a_change_is_over(elapsed_s: float, transition_s: float) -> None:
    assert ease_out_cubic(elapsed_s, transition_s) == 1


def test_keys_are_met_and_held_beyond_the_ends_and_left_gently() -> None:
    keys = [(0.0, 1.0), (2.0, 5.0), (3.0, 5.0), (4.0, -1.0)]
    assert [interpolate_keyframes(place, keys) for place in (-1, 0, 1, 2, 2.5, 3.5, 4, 9)] == pytest.approx(
        [1, 1, 3, 5, 5, 2, -1, -1]
    )
    for place, value in keys:
        for near in (place - 1e-3, place + 1e-3):
            assert interpolate_keyframes(near, keys) == pytest.approx(value, abs=1e-4)


def test_smoothstep_is_clamped_and_flat_at_both_ends() -> None:
    np.testing.assert_allclose(smoothstep([-1, 0, 0.25, 0.5, 1, 2]), [0, 0, 0.15625, 0.5, 1, 1])
    slopes = np.diff(smoothstep(np.linspace(0, 1, 1001))) * 1000
    assert max(slopes[0], slopes[-1]) < 0.01
    assert slopes.max() == pytest.approx(1.5, abs=1e-3)


def test_smoothstep_falls_where_low_is_above_high() -> None:
    np.testing.assert_allclose(smoothstep([2.0, 3.0, 4.0], 4, 2), [1, 0.5, 0])


def test_smoothstep_keeps_the_precision_of_its_input() -> None:
    assert smoothstep(np.zeros(3, np.float32), 0.0, 2.0).dtype == np.float32
    assert smoothstep(np.zeros(3)).dtype == np.float64
