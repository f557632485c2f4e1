"""Methods that fit a function to each pixel: exact on what they can express, fading beyond what was captured."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.errors import LightsError
from relit_camera.capture.reflectance.method_registry import LinearMethod
from relit_camera.capture.reflectance.methods.gaussian_process import GaussianProcess, Kernel, fit_kernel
from relit_camera.capture.reflectance.methods.linear_methods import (
    PolynomialTextureMap,
    RadialBasis,
    SphericalHarmonics,
)
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import direction_from_degrees, fibonacci_directions
from relit_camera.light.spherical_harmonics import basis
from tests.lab.lit_sphere import cap, lambert, shadowed

CAPTURED = cap(90, 60)
INSIDE = cap(40, 45)
KERNEL = Kernel(length_scale=1.0, noise=1e-3)
METHODS = [PolynomialTextureMap(), SphericalHarmonics(), RadialBasis(), KERNEL]


def predicted(method: LinearMethod, known: NDArray, queries: NDArray, captured: NDArray = CAPTURED) -> NDArray:
    """Values (queries,) that the method makes of known ones (lights,)."""
    return np.asarray(method.weights(captured, queries).T @ known)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_a_constant_stays_and_fades_to_nothing_beyond_the_region(method: LinearMethod) -> None:
    np.testing.assert_allclose(method.weights(CAPTURED, INSIDE).sum(axis=0), 1, atol=1e-3)
    far = direction_from_degrees([72.5, 110, 180], [0, 0, 0])
    fraction = method.weights(CAPTURED, far).sum(axis=0)
    assert 0.3 < fraction[0] < 0.7
    np.testing.assert_array_equal(fraction[1:], 0)


def test_a_polynomial_texture_map_is_exact_on_quadratic_polynomials() -> None:
    def value(directions: NDArray) -> NDArray:
        x, y, _ = directions.T
        return 0.3 + 0.2 * x - 0.4 * y + 0.5 * x * x - 0.6 * x * y + 0.1 * y * y

    np.testing.assert_allclose(predicted(PolynomialTextureMap(), value(CAPTURED), INSIDE), value(INSIDE), atol=1e-5)


def test_a_polynomial_texture_map_knows_nothing_of_lights_behind() -> None:
    sphere = fibonacci_directions(120)
    weights = PolynomialTextureMap().weights(sphere, sphere)
    assert not weights[sphere[:, 2] <= 0].any()
    assert not weights[:, sphere[:, 2] <= 0].any()
    with pytest.raises(LightsError, match="before the subject"):
        PolynomialTextureMap().weights(-CAPTURED, INSIDE)


def test_harmonics_are_exact_on_those_of_their_degree() -> None:
    sphere = fibonacci_directions(200)
    mixture = np.random.default_rng(4).standard_normal(16)
    seen = predicted(SphericalHarmonics(), basis(sphere, 3) @ mixture, INSIDE, sphere)
    wanted = basis(INSIDE, 3) @ mixture
    # The roughness term bends the highest degree by 2 %.
    assert np.abs(seen - wanted).max() < 0.03 * np.abs(wanted).max()
    smooth = mixture * (np.arange(16) < 4)
    np.testing.assert_allclose(
        predicted(SphericalHarmonics(), basis(sphere, 3) @ smooth, INSIDE, sphere), basis(INSIDE, 3) @ smooth, atol=5e-3
    )


@pytest.mark.parametrize("method", [RadialBasis(), Kernel(1.0, 1e-9)], ids=["rbf", "kernel"])
def test_interpolation_returns_what_was_captured_and_reproduces_a_cosine(method: LinearMethod) -> None:
    np.testing.assert_allclose(method.weights(CAPTURED, CAPTURED), np.eye(len(CAPTURED)), atol=0.02)
    cosine = CAPTURED @ [0.2, -0.3, 0.9]
    np.testing.assert_allclose(predicted(method, cosine, INSIDE), INSIDE @ [0.2, -0.3, 0.9], atol=1e-4)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_two_pictures_of_one_direction_count_as_their_mean(method: LinearMethod) -> None:
    twice = np.concatenate([CAPTURED, CAPTURED[40:41]])
    values = CAPTURED @ [0.2, -0.3, 0.9]
    apart = np.append(values, values[40])
    apart[40] += 0.2
    apart[-1] -= 0.2
    np.testing.assert_allclose(predicted(method, apart, INSIDE, twice), predicted(method, values, INSIDE), atol=0.02)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_directions_without_extent_are_refused(method: LinearMethod) -> None:
    angle = np.arange(12) / 12 * 2 * np.pi
    circle = np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), np.full(12, 0.8)], axis=1)
    with pytest.raises(LightsError):
        method.weights(circle, INSIDE)


def drawn(reach: float, noise: float, count: int = 400) -> OlatSamples:
    """Pictures whose pixels are draws of a known process, without a matte's holes."""
    covariance = Kernel(reach, noise).covariance(CAPTURED, CAPTURED) + noise * np.eye(len(CAPTURED))
    rng = np.random.default_rng(7)
    values = np.linalg.cholesky(covariance) @ rng.standard_normal((len(CAPTURED), count * 3))
    side = int(np.sqrt(count))
    pictures = values.reshape(len(CAPTURED), side, side, 3).astype(np.float32)
    return OlatSamples(pictures, CAPTURED, np.ones((side, side), np.float32))


@pytest.mark.parametrize(("reach", "noise"), [(0.5, 0.01), (1.2, 0.1)])
def test_the_kernel_is_learned_from_the_pictures(reach: float, noise: float) -> None:
    found = fit_kernel(drawn(reach, noise))
    assert found.length_scale == pytest.approx(reach, rel=0.2)
    assert found.noise == pytest.approx(noise, rel=0.3)


def test_noise_outside_of_the_matte_does_not_matter() -> None:
    samples = lambert(CAPTURED)
    dirty = samples.pictures + (samples.matte == 0)[..., None] * np.random.default_rng(0).random(
        samples.pictures.shape, np.float32
    )
    assert fit_kernel(OlatSamples(dirty, CAPTURED, samples.matte)) == fit_kernel(samples)


def test_a_process_predicts_shadows_better_than_three_neighbours_do() -> None:
    known, asked = shadowed(CAPTURED), shadowed(INSIDE)
    everywhere = np.arange(known.matte.size)
    seen = GaussianProcess().build(known).at(INSIDE, everywhere).reshape(asked.pictures.shape)
    harmonics = SphericalHarmonics().build(known).at(INSIDE, everywhere).reshape(asked.pictures.shape)
    assert np.mean((seen - asked.pictures) ** 2) < 0.8 * np.mean((harmonics - asked.pictures) ** 2)
