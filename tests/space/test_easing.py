"""Easing: from nothing to all, fast at first."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.space.easing import eased_share


def test_a_change_grows_from_nothing_to_all_and_is_fast_at_first() -> None:
    shares = np.array([eased_share(time_s, 2.0) for time_s in np.linspace(0, 2, 21)])
    assert shares[0] == 0
    assert shares[-1] == 1
    steps = np.diff(shares)
    assert (steps > 0).all()
    assert (np.diff(steps) < 0).all()


@pytest.mark.parametrize(("elapsed_s", "transition_s"), [(-3.0, 2.0), (2.0, 2.0), (9.0, 2.0), (0.0, 0.0), (0.5, 0.0)])
def test_before_its_beginning_and_after_its_end_a_change_is_over(elapsed_s: float, transition_s: float) -> None:
    assert eased_share(elapsed_s, transition_s) == 1
