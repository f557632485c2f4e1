"""The black ring round the sampled region."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.sampled_region import (
    boundary_lights,
    region_coverage,
    ring_directions,
    with_black_ring,
)
from relit_camera.light.directions import direction_from_degrees
from tests.lab.lit_sphere import cap, lambert
from tests.synthetic import fibonacci_directions


def test_the_boundary_of_a_cap_is_its_rim() -> None:
    captured = cap(120, 50)
    assert set(boundary_lights(captured)) == set(range(len(captured) - 16, len(captured)))


def test_lights_all_round_have_no_boundary_and_get_no_ring() -> None:
    captured = fibonacci_directions(100)
    assert not len(boundary_lights(captured))
    assert not len(ring_directions(captured))


def test_each_black_sample_lies_farther_out_on_its_lights_way() -> None:
    captured = cap(120, 50)
    ring = ring_directions(captured, 20)
    rim = captured[boundary_lights(captured)]
    np.testing.assert_allclose(np.linalg.norm(ring, axis=1), 1)
    np.testing.assert_allclose(np.degrees(np.arccos((ring * rim).sum(axis=1))), 20, atol=1e-6)
    # The cap's middle is the camera's axis, but for the spiral's unevenness.
    np.testing.assert_allclose(np.degrees(np.arccos(ring[:, 2])), 70, atol=1.5)


def test_no_black_sample_lies_beyond_the_pole_opposite_to_the_middle() -> None:
    captured = cap(120, 50)
    ring, rim = ring_directions(captured, 175), captured[boundary_lights(captured)]
    moved_deg = np.degrees(np.arccos((ring * rim).sum(axis=1)))
    # The pole is 130 degrees from the rim, which is uneven; nine tenths of the way is as far as a sample goes.
    np.testing.assert_allclose(moved_deg, 0.9 * 130, atol=2)


def test_the_field_fades_over_the_ring_and_stays_the_same_inside() -> None:
    samples = lambert(cap(120, 50))
    wider = with_black_ring(samples, 20)
    method = SphericalBarycentric()
    query = direction_from_degrees([0, 30, 60, 75], [10, 0, 0, 0])
    before = np.tensordot(method.weights(samples.directions, query).T, samples.pictures, 1)
    after = np.tensordot(method.weights(wider.directions, query).T, wider.pictures, 1)
    np.testing.assert_allclose(after[:2], before[:2], atol=1e-6)
    assert before[2].max() == 0
    half_way = samples.pictures[boundary_lights(samples.directions)].max()
    assert 0.3 * half_way < after[2].max() < 0.7 * half_way
    assert after[3].max() == 0


def test_the_fraction_of_a_region_is_one_inside_and_falls_over_the_ring() -> None:
    captured = cap(120, 50)
    fraction = region_coverage(captured, direction_from_degrees([0, 20, 48, 62, 90], [0, 30, 0, 0, 0]), 20)
    np.testing.assert_allclose(fraction[:3], 1, atol=1e-6)
    assert 0.2 < fraction[3] < 0.8
    assert fraction[4] == 0
    np.testing.assert_allclose(region_coverage(fibonacci_directions(100), captured), 1, atol=1e-6)
