"""Where the still sits in the output: whole, centred, on the bottom edge, and never off it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from relit_camera.live.reenactment.warp import inverse_affine, move_body, source_from_output, visible_box

STILL, OUTPUT = (150, 200), (1280, 720)


def seen_at(placed: np.ndarray, point: ArrayLike) -> np.ndarray:
    """Where a still position is seen in the output."""
    inverse = inverse_affine(placed)
    return inverse[:, :2] @ np.asarray(point) + inverse[:, 2]


@pytest.mark.parametrize("output", [(1280, 720), (640, 640), (300, 800)])
def test_the_still_is_fitted_whole_and_stands_on_the_bottom_edge(output: tuple[int, int]) -> None:
    placed = source_from_output(STILL, output)
    left, top = seen_at(placed, (0, 0))
    right, bottom = seen_at(placed, STILL)
    assert bottom == pytest.approx(output[1])
    assert left == pytest.approx(output[0] - right)
    assert min(left, top) == pytest.approx(0, abs=1e-9)
    assert (right - left) / (bottom - top) == pytest.approx(STILL[0] / STILL[1])


@given(
    shift=st.tuples(st.floats(-200, 200), st.floats(-200, 200)),
    scale=st.floats(0.5, 2),
    pivot=st.tuples(st.floats(0, 150), st.floats(50, 260)),
)
def test_the_body_never_rises_off_the_bottom_edge(
    shift: tuple[float, float], scale: float, pivot: tuple[float, float]
) -> None:
    placed = move_body(source_from_output(STILL, OUTPUT), np.array(pivot), np.array(shift), scale, STILL[1])
    assert seen_at(placed, (0, STILL[1]))[1] >= OUTPUT[1] - 1e-6


def test_a_body_moves_by_its_shift_and_grows_about_its_pivot() -> None:
    rest, pivot = source_from_output(STILL, OUTPUT), np.array([75.0, 180.0])
    per_pixel = OUTPUT[1] / STILL[1]
    moved = move_body(rest, pivot, np.array([10.0, 5.0]), 1.0, STILL[1])
    np.testing.assert_allclose(seen_at(moved, pivot) - seen_at(rest, pivot), [10 * per_pixel, 5 * per_pixel])
    grown = move_body(rest, pivot, np.zeros(2), 1.2, STILL[1])
    np.testing.assert_allclose(seen_at(grown, pivot), seen_at(rest, pivot))
    spread = seen_at(grown, pivot - [0, 100]) - seen_at(grown, pivot)
    np.testing.assert_allclose(spread, [0, -120 * per_pixel])


def test_the_visible_box_holds_all_that_is_seen() -> None:
    placed = move_body(source_from_output(STILL, OUTPUT), np.array([75.0, 180.0]), np.array([90.0, 0]), 1.1, STILL[1])
    left, top, right, bottom = visible_box(placed, STILL, OUTPUT)
    corner = seen_at(placed, (0, 0))
    assert left == np.floor(corner[0])
    assert top == max(np.floor(corner[1]), 0)
    assert (right, bottom) == (min(OUTPUT[0], int(np.ceil(seen_at(placed, STILL)[0]))), OUTPUT[1])


def test_inverse_affine_undoes() -> None:
    affine = np.array([[2.0, 0.5, 3], [-0.3, 1.5, 7]])
    both = np.vstack([affine, [0, 0, 1]]) @ np.vstack([inverse_affine(affine), [0, 0, 1]])
    np.testing.assert_allclose(both, np.eye(3), atol=1e-12)
