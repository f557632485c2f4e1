"""Methods that mix three lights by what the shape says: exact at them, and sharper between them."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.geometry.horizon_map import HorizonMap, compute_horizon_map
from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.methods.shadow_aware_interpolation import (
    LightAdaptation,
    SharpVisibilityInterpolation,
    ThesisMethod,
    VisibilityInterpolation,
    interpolate_by_visibility,
    interpolate_with_adaptation,
    smoothed_visibility,
)
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.triangle_field import TriangleVertices
from relit_camera.light.directions import direction_from_degrees
from relit_camera.subject.reflectance_field import ExactField, texel_vectors
from tests.lab.lit_sphere import cap, lambert, shadowed, wall_horizon, walled


class ExactMethod(Protocol):
    """A method whose field answers any direction."""

    def build(self, samples: OlatSamples) -> ExactField: ...


CAPTURED = cap(110, 60)
METHODS: list[ExactMethod] = [
    VisibilityInterpolation(),
    SharpVisibilityInterpolation(),
    LightAdaptation(),
    ThesisMethod(),
]
PLAIN: ExactMethod = SphericalBarycentric()
SIZE = 32


@pytest.fixture(scope="module")
def samples() -> OlatSamples:
    return shadowed(CAPTURED, SIZE)


def each(method: ExactMethod) -> str:
    return type(method).__name__


def flat(normal: NDArray[np.floating], size: int = 2) -> Geometry:
    """A plane of one normal that nothing shadows."""
    plane = np.tile(normal.astype(np.float32), (size, size, 1))
    ones = np.ones((size, size), np.float32)
    nowhere = HorizonMap(np.full((size, size, 8), -np.pi / 2, np.float16))
    return Geometry(plane, np.ones_like(plane), ones, 0 * ones, nowhere)


@pytest.mark.parametrize("method", METHODS, ids=each)
def test_a_captured_direction_returns_its_own_picture(method: ExactMethod, samples: OlatSamples) -> None:
    field = method.build(samples)
    assert isinstance(field, ExactField)
    pixels = np.flatnonzero(samples.matte.ravel())
    seen = field.at(CAPTURED, pixels)
    np.testing.assert_allclose(seen, samples.pictures.reshape(len(CAPTURED), -1, 3)[:, pixels], atol=1e-4)


@pytest.mark.parametrize("method", METHODS, ids=each)
def test_texels_are_answered_as_directions_and_nothing_outside(method: ExactMethod, samples: OlatSamples) -> None:
    field = method.build(samples)
    start, stop = SIZE * 10 + 12, SIZE * 10 + 20
    dense = field.dense(start, stop)
    assert dense.shape == (8, 2048, 3)
    assert dense.dtype == np.float32
    np.testing.assert_array_equal(dense, field.at(texel_vectors(), np.arange(start, stop)).transpose(1, 0, 2))
    assert not dense[:, texel_vectors()[:, 2] < -0.1].any()
    assert field.size == (SIZE, SIZE)


@pytest.mark.parametrize("method", METHODS, ids=each)
def test_a_constant_field_stays_constant_where_cosines_do(method: ExactMethod) -> None:
    """All lights on a circle about the plane's normal, and in its middle: there every cosine factor is 1 or alike."""
    constant = replace(lambert(CAPTURED, 2), pictures=np.ones((len(CAPTURED), 2, 2, 3), np.float32))
    field = method.build(replace(constant, known_geometry=flat(np.array([0.0, 0.0, 1.0]))))
    seen = field.at(direction_from_degrees([0, 2], [0, 3]), np.arange(4))
    np.testing.assert_allclose(seen, 1, atol=0.03)


def ghosts(seen: NDArray, lit: NDArray) -> float:
    """Fraction of the spots that are neither in shadow nor lit as brightly as without it, but between."""
    fraction = seen / lit
    return float(np.mean((fraction > 0.2) & (fraction < 0.8)))


def test_the_shadow_of_a_light_between_captured_ones_is_sharper() -> None:
    """On a ball, whose shape is found from the pictures."""
    samples, between = walled(cap(60, 60), SIZE), cap(40, 40)
    samples = replace(samples, known_geometry=replace(samples.geometry, horizon=wall_horizon(SIZE)))
    pixels = np.flatnonzero(samples.matte.ravel())
    truth = walled(between, SIZE).pictures.reshape(len(between), -1, 3)[:, pixels, 0]
    alone = lambert(between, SIZE).pictures[..., 0].reshape(len(between), -1)[:, pixels]
    bright = alone > 0.3
    seen = {
        method: method.build(samples).at(between, pixels)[..., 0]
        for method in (PLAIN, SharpVisibilityInterpolation(), ThesisMethod())
    }
    ghost = {method: ghosts(colors[bright], alone[bright]) for method, colors in seen.items()}
    error = {method: np.mean((colors - truth)[bright] ** 2) for method, colors in seen.items()}
    assert ghost[SharpVisibilityInterpolation()] < 0.6 * ghost[PLAIN]
    assert ghost[ThesisMethod()] < 0.95 * ghost[PLAIN]
    assert error[ThesisMethod()] < 0.95 * error[PLAIN]


def before_a_wall(directions: NDArray[np.float64], wall_px: float = 24.5, high_px: float = 30.0) -> NDArray[np.float32]:
    """A plain's pictures (lights, 1, 24, 3), n·l; a wall at its right casts its shadow over it."""
    x = np.arange(24) + 0.5
    right, _, toward = directions.T[..., None]
    lit = (right <= 0) | ((wall_px - x) * toward > high_px * right)
    return np.repeat((np.maximum(toward, 0) * lit)[:, None, :, None], 3, axis=3).astype(np.float32)


def test_where_the_shape_is_known_a_shadow_ends_where_it_should() -> None:
    captured, between = cap(60, 60), cap(80, 45)
    plain = flat(np.array([0.0, 0.0, 1.0]), 24)
    depth = np.zeros((201, 48), np.float32)
    depth[:, 24:] = 30
    horizon = HorizonMap(compute_horizon_map(depth).heights[100:101, :24])
    shape = replace(plain, normals=plain.normals[:1], horizon=horizon)
    samples = OlatSamples(before_a_wall(captured), captured, np.ones((1, 24), np.float32), shape)
    # At the wall's very foot horizons leave what is near to the normal.
    pixels = np.arange(21)
    truth = before_a_wall(between)[:, 0, pixels, 0]
    methods = (PLAIN, *METHODS)
    error = {m: np.mean((m.build(samples).at(between, pixels)[..., 0] - truth) ** 2) for m in methods}
    assert error[SharpVisibilityInterpolation()] < 0.2 * error[PLAIN]
    assert error[VisibilityInterpolation()] < 0.75 * error[PLAIN]
    assert error[ThesisMethod()] < 0.75 * error[PLAIN]


def test_adaptation_is_exact_for_a_matte_surface() -> None:
    normal = np.array([0.3, 0.2, 0.933])
    cosines = np.maximum(CAPTURED @ normal, 0)
    pictures = np.broadcast_to(cosines[:, None, None, None], (len(CAPTURED), 2, 2, 3)).astype(np.float32)
    given = OlatSamples(pictures, CAPTURED, np.ones((2, 2), np.float32), flat(normal))
    between = cap(30, 40)
    wanted = between @ normal
    seen = LightAdaptation().build(given).at(between, np.arange(4))[:, 0, 0]
    np.testing.assert_allclose(seen[wanted > 0.3], wanted[wanted > 0.3], atol=1e-5)
    plain = SphericalBarycentric().build(given).at(between, np.arange(4))[:, 0, 0]
    assert np.abs(plain - wanted).max() > 0.003


def triangle(
    weights: tuple[float, float, float], colors: tuple[float, float, float], cosines: tuple[float, float, float]
) -> TriangleVertices:
    """One pixel, one query in one triangle; the normal is set so that the corners have these cosine factors."""
    lights = direction_from_degrees([0, 40, 0], [0, 0, 40])
    normal = np.linalg.solve(lights, cosines)
    query = np.array(weights) @ lights
    return TriangleVertices(
        lights=lights,
        queries=query[None] / np.linalg.norm(query),
        triangles=np.array([[0, 1, 2]]),
        weights=np.array(weights, np.float32)[None, :, None],
        colors=np.tile(np.array(colors, np.float32)[None, :, None, None], (1, 1, 3, 1)),
        geometry=flat(normal, 1),
        pixels=np.array([0]),
    )


@pytest.mark.parametrize(
    "cosines", [(0.8, 0.7, 0.6), (-0.2, 0.7, 0.6), (-0.2, -0.1, 0.6), (-0.2, -0.1, -0.3), (0.02, 0.3, 0.9)]
)
def test_adaptation_gives_each_corner_its_own_colour_in_every_case(cosines: tuple[float, float, float]) -> None:
    colors = (0.15, 0.9, 0.5)
    for corner in range(3):
        first, second, third = np.eye(3)[corner].tolist()
        corners = triangle((first, second, third), colors, cosines)
        seen = interpolate_with_adaptation(corners.weights, corners)
        np.testing.assert_allclose(seen, colors[corner], rtol=1e-4)


def test_two_corners_behind_the_surface_by_the_corrected_equation() -> None:
    """Eq. 5.2 with c_ind divided by its weight, by hand."""
    corners = triangle((0.3, 0.2, 0.5), (0.1, 0.2, 0.8), (-0.2, -0.1, 0.6))
    here = float(corners.cosines[1][0, 0])
    of_indirect = 0.3 * 0.1 + 0.2 * 0.2
    direct = (0.8 - of_indirect) * here / 0.6 + of_indirect
    np.testing.assert_allclose(
        interpolate_with_adaptation(corners.weights, corners), 0.5 * direct + of_indirect, rtol=1e-4
    )


def test_one_corner_behind_the_surface_by_the_equation() -> None:
    """Eq. 5.3 by hand."""
    corners = triangle((0.3, 0.2, 0.5), (0.1, 0.7, 0.8), (-0.2, 0.4, 0.6))
    here = float(corners.cosines[1][0, 0])
    direct = (0.2 * (0.7 - 0.03) / 0.4 + 0.5 * (0.8 - 0.03) / 0.6) * here / 0.7 + 0.03
    np.testing.assert_allclose(interpolate_with_adaptation(corners.weights, corners), 0.7 * direct + 0.03, rtol=1e-4)


def test_light_from_behind_the_surface_never_makes_it_brighter() -> None:
    corners = triangle((0.9, 0.05, 0.05), (0.05, 0.9, 0.9), (-0.5, 0.1, 0.1))
    assert corners.cosines[1][0, 0] < 0
    seen = interpolate_with_adaptation(corners.weights, corners)
    assert 0 <= seen.max() < 0.2


def seen_as(corners: TriangleVertices, at_corners: tuple[float, float, float], here: float) -> float:
    visibility = np.array(at_corners, np.float32)[None, :, None], np.array([[here]], np.float32)
    colors = interpolate_by_visibility(corners, visibility, lambda w, c: (w[:, :, None] * c.colors).sum(axis=1))
    return float(colors[0, 0, 0])


def test_the_rule_of_visibility_by_hand() -> None:
    corners = triangle((0.2, 0.3, 0.5), (0.1, 0.6, 0.9), (0.5, 0.5, 0.5))
    plain = 0.2 * 0.1 + 0.3 * 0.6 + 0.5 * 0.9
    lit = (0.3 * 0.6 + 0.5 * 0.9) / 0.8
    assert seen_as(corners, (1, 1, 1), 1) == pytest.approx(plain, rel=1e-5)
    assert seen_as(corners, (0, 0, 0), 0) == pytest.approx(plain, rel=1e-5)
    assert seen_as(corners, (0, 1, 1), 1) == pytest.approx(lit, rel=1e-5)
    assert seen_as(corners, (0, 1, 1), 0) == pytest.approx(0.1, rel=1e-5)
    assert seen_as(corners, (0, 0, 1), 1) == pytest.approx(0.9, rel=1e-5)
    assert seen_as(corners, (0, 0, 1), 0) == pytest.approx((0.2 * 0.1 + 0.3 * 0.6) / 0.5, rel=1e-5)
    # Half as different counts half as much.
    assert seen_as(corners, (0.25, 0.75, 0.75), 1) == pytest.approx((plain + lit) / 2, rel=1e-5)
    # The third corner is half lit: of both cases the mean.
    assert seen_as(corners, (0, 0.5, 1), 1) == pytest.approx((lit + 0.9) / 2, rel=1e-5)


def test_smoothing_is_the_mean_over_nine_texels(samples: OlatSamples) -> None:
    pixel = np.array([SIZE * 14 + 20])
    sharp = samples.geometry.visible(texel_vectors(), pixel)[0].reshape(32, 64).astype(float)
    smooth = smoothed_visibility(samples.geometry, texel_vectors(), pixel)[0].reshape(32, 64)
    box = sum(np.roll(sharp, (down, right), (0, 1)) for down in (-1, 0, 1) for right in (-1, 0, 1)) / 9
    np.testing.assert_allclose(smooth[1:-1], box[1:-1], atol=1e-6)


def test_the_thesis_fades_over_the_black_ring(samples: OlatSamples) -> None:
    pixel = np.array([SIZE * 20 + 10])
    seen = ThesisMethod().build(samples).at(direction_from_degrees([0, 58, 72, 90], [0, 0, 0, 0]), pixel)[:, 0, 0]
    assert seen[0] > seen[1] > seen[2] > 0 == seen[3]
