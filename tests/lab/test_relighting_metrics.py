"""The thesis's error measure, its weights and its region, against formulas."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import LightsError
from relit_camera.base.images.image_quality import psnr
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth, not_captured, sampled_region, subsample_lights
from relit_camera.lab.evaluate.field.relighting_metrics import (
    compare_under_environments,
    pixel_errors,
    psnr_per_light,
    squared_distances,
)
from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles
from relit_camera.light.light_map import resample_to_light_map, total
from tests.lab.lit_sphere import cap, grid, lambert


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return GroundTruth(lambert(grid(32)))


@pytest.mark.slow
def test_weights_on_the_thesis_grid_are_the_cosine_of_the_elevation(truth: GroundTruth) -> None:
    elevation = np.pi * (0.5 - (np.arange(32) + 0.5) / 32)
    np.testing.assert_allclose(truth.weights.reshape(32, 64), np.repeat(np.cos(elevation)[:, None], 64, axis=1))
    np.testing.assert_array_equal(truth.light_of_texel, np.arange(2048))


def test_weights_of_a_coarser_grid_are_shared_out_by_row() -> None:
    weights = GroundTruth(lambert(grid(8))).weights.reshape(8, 16)
    fine = np.cos(np.pi * (0.5 - (np.arange(32) + 0.5) / 32)).reshape(8, 4).sum(axis=1) * 4
    np.testing.assert_allclose(weights.sum(axis=1) / 16, fine, rtol=0.02)
    assert weights.sum() == pytest.approx(fine.sum() * 16)


@pytest.mark.slow
def test_a_constant_error_is_itself(truth: GroundTruth) -> None:
    wrong = truth.colors + np.array([0.1, 0.0, -0.2], np.float32)
    error = pixel_errors(squared_distances(wrong, truth.colors), truth.weights)
    np.testing.assert_allclose(error, 0.01 + 0.04, rtol=1e-5)


def test_an_error_near_the_pole_weighs_less(truth: GroundTruth) -> None:
    def error_of_row(row: int) -> float:
        wrong = truth.colors.copy().reshape(32, 64, -1, 3)
        wrong[row] += 1
        distances = squared_distances(wrong.reshape(2048, -1, 3), truth.colors)
        return float(pixel_errors(distances, truth.weights).mean())

    # One row's cos φ over that of all 32, whose sum is 1 / sin(π / 64).
    for row in (0, 8, 15):
        cosine = np.cos(np.pi * (0.5 - (row + 0.5) / 32))
        assert error_of_row(row) == pytest.approx(3 * cosine * np.sin(np.pi / 64), rel=1e-4)


def test_only_counted_lights_count(truth: GroundTruth) -> None:
    wrong = truth.colors.copy()
    front = truth.directions[:, 2] > 0
    wrong[~front] += 1
    distances = squared_distances(wrong, truth.colors)
    assert pixel_errors(distances, truth.weights, front).max() == 0
    assert pixel_errors(distances, truth.weights, ~front) == pytest.approx(3)
    with pytest.raises(ValueError, match="no light counts"):
        pixel_errors(distances, truth.weights, np.zeros(2048, bool))


def test_the_hull_of_a_cap_is_the_cap() -> None:
    captured = cap(200, 50)
    axis = np.degrees(np.arccos(np.clip(grid(32)[:, 2], -1, 1)))
    inside = sampled_region(captured, grid(32))
    assert inside[axis < 46].all()
    assert not inside[axis > 50.5].any()
    # Half way along a chord of the rim, 22.5° wide, the hull reaches atan(tan 50° cos 11.25°) = 49.5° at least.
    assert inside[axis < 49].mean() > 0.97


def test_captured_directions_are_told_from_others() -> None:
    captured = direction_from_degrees([0, 10], [0, 0])
    asked = direction_from_degrees([0.05, 0.2, 10], [0, 0, 0])
    assert not_captured(captured, asked).tolist() == [False, True, False]


def test_light_is_shared_out_without_loss(truth: GroundTruth) -> None:
    light_map = resample_to_light_map(np.random.default_rng(1).random((64, 128, 3), np.float32))
    for known in (truth, GroundTruth(lambert(grid(8)))):
        np.testing.assert_allclose(known.irradiance(light_map).sum(axis=0), total(light_map), rtol=1e-5)


def test_relit_is_the_sum_over_directions_and_scores_as_quality_says(truth: GroundTruth) -> None:
    light_map = np.ones((32, 64, 3), np.float32)
    half = truth.colors * np.float32(0.5)
    relit = compare_under_environments(half, truth, {"white": light_map})["white"]
    # A white ball in even light of radiance 1 shows π everywhere in the project's unit.
    weights = texel_solid_angles().ravel()
    expected = truth.picture(np.einsum("lpc,l->pc", truth.colors, weights).astype(np.float32))
    inside = truth.samples.matte > 0.5
    np.testing.assert_allclose(expected[inside], np.pi, rtol=5e-3)
    assert relit.psnr_db == pytest.approx(psnr(expected * 0.5, expected, truth.samples.matte), abs=1e-3)
    assert 0 < relit.ssim < 1


def test_single_lights_score_as_quality_says(truth: GroundTruth) -> None:
    light = int(texel_directions().reshape(-1, 3)[:, 2].argmax())
    noisy = truth.colors + np.random.default_rng(2).normal(0, 0.01, truth.colors.shape).astype(np.float32)
    matte = truth.samples.matte
    expected = psnr(truth.picture(noisy[light]), truth.picture(truth.colors[light]), matte)
    assert psnr_per_light(noisy, truth.colors, np.array([light])) == pytest.approx([expected])


def test_lights_are_chosen_by_angle_and_stride() -> None:
    samples = lambert(grid(8))
    near = subsample_lights(samples, within_deg=60)
    assert near.directions[:, 2].min() >= 0.5
    assert len(near.directions) == (samples.directions[:, 2] >= 0.5).sum()
    np.testing.assert_array_equal(subsample_lights(samples, every=3).directions, samples.directions[::3])
    with pytest.raises(LightsError, match="keep 4"):
        subsample_lights(samples, within_deg=5)
