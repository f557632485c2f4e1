"""Before and after side by side."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.live.modes.live_mode import split_view

BEFORE, AFTER = (np.full((4, 40, 3), value, np.uint8) for value in (10, 200))


@pytest.mark.parametrize(("share", "columns"), [(0.25, 10), (0.5, 20)])
def test_the_left_share_is_as_it_was_filmed(share: float, columns: int) -> None:
    shown = split_view(AFTER, BEFORE, share)
    assert (shown[:, : columns - 1] == 10).all()
    assert (shown[:, columns - 1 : columns + 1] == 255).all()
    assert (shown[:, columns + 1 :] == 200).all()
    assert (AFTER == 200).all()


def test_all_or_nothing_has_no_line() -> None:
    assert split_view(AFTER, BEFORE, 0.0) is AFTER
    np.testing.assert_array_equal(split_view(AFTER, BEFORE, 1.0), BEFORE)
