"""Normals and albedo of a ball, with everything that goes wrong in real pictures."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.geometry.photometric_stereo import photometric_stereo
from tests.capture.geometry.shapes import angles_deg, ball, front_lights, lambert

ALBEDO = np.array([0.6, 0.4, 0.3], np.float32)


@pytest.fixture(scope="module")
def pictures() -> NDArray[np.float32]:
    return lambert(*ball(), ALBEDO, front_lights())


def test_a_matte_ball_is_found_exactly(pictures: NDArray[np.float32]) -> None:
    truth, matte = ball()
    found = photometric_stereo(pictures, front_lights(), matte)
    inside = matte > 0
    assert angles_deg(found.normals, truth, inside).max() < 0.5
    np.testing.assert_allclose(found.albedo[inside], np.tile(ALBEDO, (inside.sum(), 1)), rtol=0.01)
    assert found.confidence[inside].min() > 0.5
    assert not found.confidence[~inside].any()


def test_fractions_of_light_are_one_where_the_light_is_before_the_surface(pictures: NDArray[np.float32]) -> None:
    truth, matte = ball()
    found = photometric_stereo(pictures, front_lights(), matte)
    cosine = np.einsum("hwc,lc->lhw", truth, front_lights()) * matte
    np.testing.assert_allclose(found.lit[cosine > 0.2], 1, atol=0.02)
    assert np.isnan(found.lit[cosine < 0.1]).all()


def test_shadows_and_highlights_do_not_bend_normals(pictures: NDArray[np.float32]) -> None:
    truth, matte = ball()
    disturbed, rng = pictures.copy(), np.random.default_rng(3)
    fate = rng.random(disturbed.shape[:3])
    disturbed[fate < 0.25] *= 0.05
    disturbed[fate > 0.95] += 1.5
    found = photometric_stereo(disturbed, front_lights(), matte)
    facing = (matte > 0) & (truth[..., 2] > 0.4)
    assert np.median(angles_deg(found.normals, truth, facing)) < 0.5
    assert np.percentile(angles_deg(found.normals, truth, facing), 95) < 3
    lit, before = found.lit, np.einsum("hwc,lc->lhw", truth, front_lights()) > 0.3
    assert np.nanmedian(lit[(fate < 0.25) & facing & before]) == pytest.approx(0.05, abs=0.01)


def test_wrong_strengths_and_directions_do_little(pictures: NDArray[np.float32]) -> None:
    """Nominal directions are 3° off, strobes vary by a tenth."""
    truth, matte = ball()
    rng = np.random.default_rng(1)
    gains = 1 + 0.1 * rng.standard_normal(len(pictures))
    told = front_lights() + np.radians(3) / np.sqrt(2) * rng.standard_normal((len(pictures), 3))
    told /= np.linalg.norm(told, axis=1, keepdims=True)
    found = photometric_stereo((pictures * gains[:, None, None, None]).astype(np.float32), told, matte)
    assert angles_deg(found.normals, truth, (matte > 0) & (truth[..., 2] > 0.3)).mean() < 3


def test_what_is_black_is_unknown(pictures: NDArray[np.float32]) -> None:
    dark = pictures.copy()
    dark[:, 20:24, 20:24] = 0
    found = photometric_stereo(dark, front_lights(), ball()[1])
    assert not found.confidence[20:24, 20:24].any()
    np.testing.assert_array_equal(found.normals[20:24, 20:24], np.tile([0, 0, 1], (4, 4, 1)))
    assert np.isfinite(found.albedo).all()
    assert np.isnan(found.lit[:, 20:24, 20:24]).all()


def test_two_lights_are_not_trusted() -> None:
    truth, matte = ball()
    two = np.array([[0.5, 0.0, 0.866], [-0.5, 0.0, 0.866], [0.0, -0.999, 0.0447], [0.1, -0.994, 0.0447]])
    upper = np.zeros_like(matte)
    upper[5:20] = matte[5:20]
    found = photometric_stereo(lambert(truth, matte, ALBEDO, two), two, matte)
    # The upper half sees the first two alone.
    assert found.confidence[(upper > 0) & (truth[..., 1] > 0.2)].max() < 0.3
