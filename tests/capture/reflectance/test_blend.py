"""The default and the model in it: better than interpolation where lights are known, and not black beyond."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.errors import LightsError
from relit_camera.capture.lights_file import MIN_LIGHTS
from relit_camera.capture.reflectance.method_registry import (
    DEFAULT_METHOD,
    ReflectanceMethod,
    factored_field,
    open_method,
)
from relit_camera.capture.reflectance.methods.appearance_field import (
    KERNEL_CANDIDATES,
    AppearanceMethod,
    choose_kernel,
    residual_weights,
)
from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.methods.blend import Blend, BlendField, choose_model_fraction
from relit_camera.capture.reflectance.methods.gaussian_process import Kernel
from relit_camera.capture.reflectance.methods.linear_methods import RadialBasis
from relit_camera.capture.reflectance.methods.shadow_aware_interpolation import ThesisMethod
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import region_coverage
from relit_camera.light.directions import direction_from_degrees
from relit_camera.subject.reflectance_field import ExactField, texel_vectors
from tests.lab.lit_sphere import cap, lambert, shadowed

SIZE = 32
CAPTURED = cap(70, 60)
BETWEEN = cap(50, 45)


@pytest.fixture(scope="module")
def samples() -> OlatSamples:
    return shadowed(CAPTURED, SIZE)


@pytest.fixture(scope="module")
def truth() -> NDArray[np.float32]:
    return shadowed(BETWEEN, SIZE).pictures.reshape(len(BETWEEN), -1, 3)


def inside(samples: OlatSamples) -> NDArray[np.intp]:
    return np.flatnonzero(samples.matte.ravel() > 0.5)


def error(method: ReflectanceMethod, samples: OlatSamples, truth: NDArray[np.float32]) -> float:
    field = method.build(samples)
    assert isinstance(field, ExactField)
    pixels = inside(samples)
    return float(np.mean((field.at(BETWEEN, pixels) - truth[:, pixels]) ** 2))


def test_the_default_is_the_blend() -> None:
    assert DEFAULT_METHOD == "blend"
    assert isinstance(open_method("default"), Blend)


@pytest.mark.slow
def test_of_what_casts_a_shadow_and_is_not_in_the_picture_interpolation_knows_no_more(
    samples: OlatSamples, truth: NDArray
) -> None:
    plain, thesis = error(SphericalBarycentric(), samples, truth), error(ThesisMethod(), samples, truth)
    assert error(AppearanceMethod(), samples, truth) < 0.95 * plain
    assert error(Blend(), samples, truth) < min(0.95 * plain, thesis)


@pytest.mark.slow
def test_of_what_is_in_the_picture_they_know_much_more() -> None:
    samples, truth = lambert(CAPTURED, SIZE), lambert(BETWEEN, SIZE).pictures.reshape(len(BETWEEN), -1, 3)
    plain = error(SphericalBarycentric(), samples, truth)
    assert error(AppearanceMethod(), samples, truth) < 0.3 * plain
    assert error(Blend(), samples, truth) < 0.6 * plain


@pytest.mark.parametrize(("method", "off"), [(AppearanceMethod(), 0.03), (Blend(), 0.06)], ids=["model", "blend"])
def test_a_captured_direction_nearly_returns_its_own_picture(
    method: ReflectanceMethod, off: float, samples: OlatSamples
) -> None:
    field = method.build(samples)
    assert isinstance(field, ExactField)
    pixels = inside(samples)
    own = samples.pictures.reshape(len(CAPTURED), -1, 3)[:, pixels]
    assert np.sqrt(np.mean((field.at(CAPTURED, pixels) - own) ** 2)) < off


@pytest.mark.parametrize("method", [AppearanceMethod(), Blend()], ids=["model", "blend"])
def test_texels_are_exact_directions_and_blocks_are_pixels(method: ReflectanceMethod, samples: OlatSamples) -> None:
    field = method.build(samples)
    assert isinstance(field, ExactField)
    assert field.size == (SIZE, SIZE)
    pixels = np.arange(400, 440)
    np.testing.assert_allclose(field.dense(400, 440), field.at(texel_vectors(), pixels).transpose(1, 0, 2), atol=1e-5)


@pytest.mark.slow
def test_beyond_the_sampled_region_the_blend_is_the_model_and_goes_on() -> None:
    """A white ball lit from 40 degrees outside of what was captured: interpolation has long been black."""
    samples = lambert(cap(60, 50), SIZE)
    pixels = inside(samples)
    side = direction_from_degrees([90.0], [0.0])
    np.testing.assert_array_equal(region_coverage(samples.directions, side), 0)
    truth = lambert(side, SIZE).pictures.reshape(1, -1, 3)[:, pixels]
    found = Blend().build(samples).at(side, pixels)
    np.testing.assert_allclose(found, AppearanceMethod().build(samples).at(side, pixels), atol=1e-6)
    assert np.sqrt(np.mean((found - truth) ** 2)) < 0.25 * np.sqrt(np.mean(truth**2))


@pytest.mark.parametrize("fraction", [0.0, 0.3])
def test_whatever_its_share_inside_the_model_has_the_rest_beyond(fraction: float) -> None:
    """Where the splines fade the model takes over what they lose; it may have no share at all inside."""
    samples = lambert(cap(60, 50), SIZE)
    pixels = inside(samples)
    built = Blend().build(samples)
    field = BlendField(built.modelled, built.smooth, fraction)
    side, fading = direction_from_degrees([90.0], [0.0]), direction_from_degrees([70.0], [0.0])
    np.testing.assert_allclose(field.at(side, pixels), field.modelled.at(side, pixels), atol=1e-6)
    covered = float(region_coverage(samples.directions, fading)[0])
    assert 0.1 < covered < 0.9
    weight = fraction + (1 - fraction) * (1 - covered)
    smooth = np.maximum(field.smooth.at(fading, pixels), 0)
    expected = weight * field.modelled.at(fading, pixels) + (1 - fraction) * smooth
    np.testing.assert_allclose(field.at(fading, pixels), expected, atol=1e-6)
    whole = shadow_free_brightness(fading, pixels)
    np.testing.assert_allclose(field.at(fading, pixels).mean(), whole, rtol=0.1)


def shadow_free_brightness(directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> float:
    """The mean of the white ball itself under a light."""
    return float(lambert(directions, SIZE).pictures.reshape(1, -1, 3)[:, pixels].mean())


@pytest.mark.slow
def test_inside_the_region_the_blend_is_the_mean_of_its_parts(samples: OlatSamples) -> None:
    pixels = inside(samples)[:50]
    field = Blend().build(samples)
    assert 0 < field.fraction < 1
    smooth = np.maximum(RadialBasis().build(samples).at(BETWEEN, pixels), 0)
    expected = field.fraction * AppearanceMethod().build(samples).at(BETWEEN, pixels) + (1 - field.fraction) * smooth
    np.testing.assert_allclose(field.at(BETWEEN, pixels), expected, atol=1e-5)


@pytest.mark.slow
def test_the_model_has_the_larger_fraction_where_the_shape_tells_the_shadows() -> None:
    bare, hidden = (
        choose_model_fraction(AppearanceMethod().build(make(CAPTURED, SIZE))) for make in (lambert, shadowed)
    )
    assert bare > hidden
    assert bare > 0.7


def test_the_kernel_is_one_of_the_candidates_and_noisier_pictures_get_a_smoother_one() -> None:
    def noise(amount: float) -> float:
        samples = shadowed(CAPTURED, SIZE)
        grain = np.random.default_rng(1).normal(0, amount, samples.pictures.shape).astype(np.float32)
        noisy = replace(samples, pictures=samples.pictures + grain, known_geometry=samples.geometry)
        kernel = choose_kernel(noisy, inside(noisy))
        assert kernel in KERNEL_CANDIDATES
        return kernel.noise

    assert noise(0.3) > noise(0.0)


def test_the_fewest_lights_are_fewer_than_parts_to_judge_by() -> None:
    few = lambert(direction_from_degrees(np.array([-40, 40, 0, 0]), np.array([0, 0, 40, 10])), SIZE)
    assert len(few.directions) == MIN_LIGHTS
    assert choose_kernel(few, inside(few)) in KERNEL_CANDIDATES
    assert np.isfinite(Blend().build(few).dense(0, SIZE)).all()


def test_residuals_count_for_nothing_far_from_every_light_and_for_themselves_at_their_own() -> None:
    weights = residual_weights(Kernel(0.3, 0.3), CAPTURED, np.array([[0.0, 0.0, -1.0]]))
    assert np.abs(weights).max() < 1e-3
    own = residual_weights(Kernel(0.3, 0.3), CAPTURED, CAPTURED)
    np.testing.assert_allclose(own, np.eye(len(CAPTURED)), atol=0.06)


@pytest.mark.parametrize("method", [AppearanceMethod(), Blend()], ids=["model", "blend"])
def test_directions_that_span_no_region_are_refused(method: ReflectanceMethod) -> None:
    line = direction_from_degrees(np.linspace(-40, 40, 9), np.zeros(9))
    with pytest.raises(LightsError):
        method.build(lambert(line))


def test_a_factored_field_is_not_what_the_blend_is(samples: OlatSamples) -> None:
    """The blend decides pixel by pixel: no set of weights makes it of the captured pictures."""
    pixels = inside(samples)
    blend = Blend().build(samples).at(BETWEEN, pixels).reshape(len(BETWEEN), -1)
    captured = factored_field(SphericalBarycentric(), samples).pictures.reshape(len(CAPTURED), -1, 3)[:, pixels]
    flat = captured.reshape(len(CAPTURED), -1)
    weights = np.linalg.lstsq(flat.T, blend.T, rcond=None)[0]
    assert np.mean((flat.T @ weights - blend.T) ** 2) > 1e-5
