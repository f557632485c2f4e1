"""Spherical harmonics: what has a closed form comes out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import lebedev_rule
from scipy.special import sph_harm_y

from relit_camera.light.directions import direction_from_spherical, texel_directions
from relit_camera.light.light_map import total
from relit_camera.light.spherical_harmonics import basis, coefficient_count, project, reconstruct


def test_they_are_orthonormal() -> None:
    points, weights = lebedev_rule(31)
    values = basis(points.T, 8)
    np.testing.assert_allclose(values.T @ (values * weights[:, None]), np.eye(coefficient_count(8)), atol=1e-10)


def test_they_are_those_of_scipy_made_real() -> None:
    azimuth, elevation = np.array([0.3, -2.1]), np.array([0.4, -1.0])
    ours = basis(direction_from_spherical(azimuth, elevation), 4)
    for l, m in ((0, 0), (1, 1), (3, 2), (4, 3)):  # noqa: E741
        complex_value = sph_harm_y(l, m, np.pi / 2 - elevation, azimuth)
        scale = (-1) ** m * np.sqrt(2 if m else 1)
        np.testing.assert_allclose(ours[:, l * l + l + m], scale * complex_value.real, atol=1e-12)
        if m:
            np.testing.assert_allclose(ours[:, l * l + l - m], scale * complex_value.imag, atol=1e-12)


@pytest.mark.parametrize("degree", [0, 2, 8])
def test_a_constant_map_has_one_coefficient_and_comes_back(degree: int) -> None:
    light_map = np.full((32, 64, 3), [1.0, 0.5, 2.0], np.float32)
    coefficients = project(light_map, degree)
    np.testing.assert_allclose(coefficients[0], np.sqrt(4 * np.pi) * np.array([1.0, 0.5, 2.0]), rtol=1e-6)
    np.testing.assert_allclose(coefficients[1:], 0, atol=1e-6)
    np.testing.assert_allclose(reconstruct(coefficients), light_map, rtol=1e-5)


def test_a_raised_cosine_lobe_comes_back_exactly_from_four_coefficients() -> None:
    toward = direction_from_spherical(0.7, 0.3)
    lobe = (1 + texel_directions() @ toward)[..., None] * np.array([1.0, 2.0, 3.0])
    light_map = lobe.astype(np.float32)
    np.testing.assert_allclose(reconstruct(project(light_map, 1)), light_map, atol=1e-5)


def test_a_clamped_cosine_lobe_has_the_known_coefficients() -> None:
    # Ramamoorthi and Hanrahan 2001: A_0 = π, A_1 = 2π / 3, A_2 = π / 4, A_3 = 0, each times Y_l0 about the lobe's axis.
    lobe = np.maximum(texel_directions()[..., 1], 0)[..., None].repeat(3, axis=2).astype(np.float32)
    coefficients = project(lobe, 3)[:, 0]
    known = {0: np.pi, 1: 2 * np.pi / 3, 2: np.pi / 4, 3: 0.0}
    for l, amount in known.items():  # noqa: E741
        at_axis = np.sqrt((2 * l + 1) / (4 * np.pi))
        assert coefficients[l * l + l] == pytest.approx(amount * at_axis, abs=4e-3)


def test_no_light_is_negative_and_none_is_lost() -> None:
    lamp = np.zeros((32, 64, 3), np.float32)
    lamp[10, 40] = [100, 10, 0]
    seen = reconstruct(project(lamp, 3))
    assert seen.min() == 0
    np.testing.assert_allclose(total(seen), total(lamp), rtol=0.01)
