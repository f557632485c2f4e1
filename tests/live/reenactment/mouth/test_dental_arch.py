"""A row of teeth: its outline from the front, what it shows from the side, and where nothing is seen."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.live.reenactment.mouth.dental_arch import LOWER_TEETH, UPPER_TEETH, DentalArch, TeethInView

PIXEL_CM = 0.02
AHEAD = np.array([0, 0, -1], np.float32)


def seen(
    arch: DentalArch, direction: NDArray[np.float32] = AHEAD
) -> tuple[NDArray[np.float64], NDArray[np.float64], TeethInView, NDArray[np.float32]]:
    """A view of 8 by 4 cm about the front teeth's edge, as pictures; rows from the top."""
    x, y = np.meshgrid(np.arange(-4, 4, PIXEL_CM), np.arange(2, -2, -PIXEL_CM))
    origins = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)]).astype(np.float32)
    found = arch.seen(origins, direction, (0.0, -0.5), PIXEL_CM)
    return x, y, found, found.teeth.reshape(x.shape)


def test_upper_teeth_lie_above_their_edge_and_lower_ones_below() -> None:
    for arch in (UPPER_TEETH, LOWER_TEETH):
        _, y, found, teeth = seen(arch)
        middle = teeth[:, 190:210].max(axis=1) > 0.5
        heights = arch.up * y[middle, 0]
        assert -PIXEL_CM <= heights.min() < 0.1
        assert heights.max() == pytest.approx(arch.crowns[0], abs=0.1)
        gum = found.gum.reshape(y.shape)[:, 200] > 0.5
        assert (arch.up * y[gum, 0]).min() > heights.max() - 0.3


def test_both_sides_are_alike() -> None:
    _, _, found, teeth = seen(UPPER_TEETH)
    shade = found.shade.reshape(teeth.shape)
    np.testing.assert_allclose(teeth[:, 1:], teeth[:, :0:-1], atol=0.05)
    np.testing.assert_allclose(shade[:, 1:], shade[:, :0:-1], atol=0.05)


def test_it_is_as_wide_as_it_says_and_bends_back() -> None:
    x, _, found, teeth = seen(UPPER_TEETH)
    wide = np.abs(x[teeth > 0.5]).max()
    assert 0.8 * UPPER_TEETH.half_width < wide <= UPPER_TEETH.half_width
    row = teeth.shape[0] // 2 - int(0.5 / PIXEL_CM)
    facing = found.toward_front.reshape(teeth.shape)[row, teeth[row] > 0.5]
    assert facing.max() > 0.99
    assert facing[0] < 0.7 > facing[-1]
    depth = found.points[2].reshape(teeth.shape)[row, teeth[row] > 0.5]
    assert depth.max() == pytest.approx(-0.5, abs=0.01)
    assert depth[0] < -1.5 > depth[-1]


def test_teeth_part_at_their_widths() -> None:
    x, _, found, teeth = seen(UPPER_TEETH)
    row = teeth.shape[0] // 2 - int(0.5 / PIXEL_CM)
    shade = found.shade.reshape(teeth.shape)[row]
    darkest = [at for at in range(1, len(shade) - 1) if shade[at - 1] > shade[at] <= shade[at + 1] and shade[at] < 0.7]
    lines = np.unique(np.round(np.abs(x[0, darkest]), 1))
    np.testing.assert_allclose(lines[:3], [0, 0.85, 1.4], atol=0.08)  # the second line is bent away by a tenth


@pytest.mark.parametrize("side", [-1, 1])
def test_a_turned_row_shows_more_of_the_side_that_is_turned_to_the_camera(side: int) -> None:
    turned = np.array([side * np.sin(np.radians(30)), 0, -np.cos(np.radians(30))], np.float32)
    x, _, found, teeth = seen(UPPER_TEETH, turned)
    shown = found.points[0].reshape(x.shape)[teeth > 0.5]
    assert side * (shown.min() + shown.max()) < -0.4
    front = found.toward_front.reshape(x.shape)[teeth > 0.5]
    assert front.min() < 0.5 < 0.99 < front.max()


def test_its_outline_is_soft_where_it_turns_away() -> None:
    turned = np.array([np.sin(np.radians(30)), 0, -np.cos(np.radians(30))], np.float32)
    _, _, _, teeth = seen(UPPER_TEETH, turned)
    row = teeth[teeth.shape[0] // 2 - int(0.4 / PIXEL_CM)]
    assert np.abs(np.diff(row)).max() < 0.5


def test_beside_it_is_nothing() -> None:
    x, _, found, teeth = seen(UPPER_TEETH)
    beside = np.abs(x) > UPPER_TEETH.half_width
    assert teeth[beside].max() == 0
    assert found.gum.reshape(x.shape)[beside].max() == 0
    assert teeth.max() == 1


def test_nothing_breaks_where_a_ray_is_along_the_row() -> None:
    for direction in ([0, -1, 0], [1, 0, 0], [0, 0, 1]):
        found = UPPER_TEETH.seen(np.zeros((3, 4), np.float32), np.array(direction, np.float32), (0.0, -0.5), 0.05)
        assert all(np.isfinite(part).all() for part in (found.points, found.teeth, found.gum, found.shade))
