"""Depth that stays near a generic head's, without which an error of depth feeds itself."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.desk.person.generic_head import GenericHead, ellipsoid_head
from relit_camera.capture.desk.person.near_field_rounds import MAX_DEPARTURE_CM, bounded_points
from tests.capture.desk.desk_person import CENTER, PIXELS_PER_CM, SIZE

SPOT = np.s_[40:44, 40:44]


@pytest.fixture(scope="module")
def head() -> GenericHead:
    return ellipsoid_head(CENTER, PIXELS_PER_CM, np.ones((SIZE, SIZE), np.float32))


def test_the_head_s_own_depth_comes_back_whatever_its_origin(head: GenericHead) -> None:
    for origin_px in (0, -200, 35):
        depth = head.points_cm[..., 2] * head.pixels_per_cm + origin_px
        np.testing.assert_allclose(bounded_points(depth.astype(np.float32), head), head.points_cm, atol=1e-3)


def test_depth_is_in_centimeters_within_reach_of_the_generic_head(head: GenericHead) -> None:
    depth = head.points_cm[..., 2] * head.pixels_per_cm
    depth[SPOT] += 2 * head.pixels_per_cm
    moved = bounded_points(depth, head) - head.points_cm
    assert np.abs(moved[..., :2]).max() == 0
    # The mean of the face stays, so all else moves back a little.
    raised, others = moved[SPOT][..., 2], np.delete(moved[..., 2][head.face], 0)
    assert raised.mean() - np.median(others) == pytest.approx(2, abs=1e-3)
    assert moved[..., 2][head.face].mean() == pytest.approx(0, abs=1e-3)


def test_no_point_departs_by_more_than_it_may(head: GenericHead) -> None:
    depth = head.points_cm[..., 2] * head.pixels_per_cm
    depth[40:42] += 30 * head.pixels_per_cm
    depth[44:46] -= 30 * head.pixels_per_cm
    moved = (bounded_points(depth, head) - head.points_cm)[..., 2]
    assert moved.max() == pytest.approx(MAX_DEPARTURE_CM, abs=1e-3)
    assert moved.min() == pytest.approx(-MAX_DEPARTURE_CM, abs=1e-3)


def test_where_depth_is_unknown_the_generic_head_is_there(head: GenericHead) -> None:
    depth = head.points_cm[..., 2] * head.pixels_per_cm + 9
    depth[SPOT] = np.nan
    np.testing.assert_allclose(bounded_points(depth, head), head.points_cm, atol=1e-3)
    nothing = np.full_like(depth, np.nan)
    nothing[~head.face] = 0
    assert bounded_points(nothing, head) is head.points_cm
