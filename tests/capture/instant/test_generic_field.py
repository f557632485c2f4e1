"""The generic field: its parts agree, and compressing it keeps it."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.image_quality import psnr
from relit_camera.capture.instant.response.generic_compression import compress_generic_field
from relit_camera.capture.instant.response.generic_reflectance import AMOUNTS, GenericField
from relit_camera.capture.reflectance.appearance_model import distant_terms
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.reflectance_field import TEXELS, texel_vectors
from tests.capture.instant.canonical_person import person_matte
from tests.capture.instant.lit_person import SIDE, SKIN, generic_person, person, window


@pytest.fixture(scope="module")
def field() -> GenericField:
    rng = np.random.default_rng(3)
    albedo = (SKIN * rng.uniform(0.5, 1.2, (SIDE, SIDE, 1))).astype(np.float32)
    return GenericField(person()[1], albedo, rng.uniform(0.4, 1, (SIDE, SIDE)).astype(np.float32))


@pytest.fixture(scope="module")
def matte() -> np.ndarray:
    return person_matte(SIDE // 2, 1.5).repeat(2, axis=0).repeat(2, axis=1)


def test_a_picture_under_light_is_the_sum_of_its_rows(field: GenericField) -> None:
    light = window(40)
    start = 60 * SIDE
    rows = field.dense(start, start + 100)
    assert rows.shape == (100, TEXELS, 3)
    expected = np.einsum("ptc,tc->pc", rows, light)
    np.testing.assert_allclose(field.pictures(light[None])[0].reshape(-1, 3)[start : start + 100], expected, rtol=1e-4)


def test_on_the_face_it_is_the_appearance_model_with_softer_shadows() -> None:
    shape, response, _ = generic_person()
    cheek = np.flatnonzero((shape.skin & (shape.certainty > 0.999)).ravel())[::40]
    chosen = np.searchsorted(response.pixels, cheek)
    terms = distant_terms(shape.geometry, texel_vectors(), cheek)
    amounts = np.array([AMOUNTS.diffuse, AMOUNTS.wrap, 0, 0, AMOUNTS.surroundings])
    expected = np.einsum("t,ptl->pl", amounts, terms)
    margins = shape.geometry.horizon.margins(texel_vectors(), cheek)
    clear = np.abs(margins) > 0.8
    np.testing.assert_allclose(response.diffuse[chosen][clear], expected[clear], atol=0.01)


def test_hair_and_clothes_have_no_shadow_edges(field: GenericField) -> None:
    """Lit from the side that they face they are never black, and their light changes slowly with its direction."""
    shape, response, _ = generic_person()
    vague = np.flatnonzero(shape.certainty.ravel()[response.pixels] < 0.01)
    assert len(vague) > 50
    facing = shape.geometry.cosines(texel_vectors(), response.pixels[vague])
    assert response.diffuse[vague][facing > 0.3].min() > 0.2


@pytest.mark.slow
def test_compressed_it_is_the_same_field(field: GenericField, matte: np.ndarray) -> None:
    maps = [builtin_environment(name).light_map for name in BUILTIN_NAMES]
    target = CompressionTarget(texel_db=38.0, maps=maps)
    compressed = compress_generic_field(field, matte, target)
    pixels = np.flatnonzero(matte.ravel() > 0.5)
    for light in (window(-60, around=0), window(0), window(100, 45)):
        truth = field.pictures(light[None])[0].reshape(-1, 3)[pixels]
        by_channel = compressed.basis.at(compressed.coefficients @ light, pixels)
        seen = np.stack([by_channel[channel, :, channel] for channel in range(3)], axis=1)
        assert psnr(seen[None], truth[None]) > 45
    quality = compressed.quality
    assert quality.map_db is not None
    assert quality.map_db > 45
    texels = np.random.default_rng(0).choice(TEXELS, 200, replace=False)
    some = pixels[::23]
    seen = compressed.basis.at(np.ascontiguousarray(compressed.coefficients[:, texels]), some)
    truth = field.rows(some)[:, texels].transpose(1, 0, 2)
    peak = np.maximum(np.percentile(truth.reshape(len(truth), -1), 99.5, axis=1), 0.01 * truth.max())
    worst = float((-10 * np.log10(((seen - truth) ** 2).mean(axis=(1, 2)) / peak**2 + 1e-20)).min())
    assert worst > 30
    assert quality.texel_db == pytest.approx(worst, abs=6)
    assert quality.bytes_share < 0.05
    assert (compressed.basis.at(compressed.coefficients[:, :4], np.flatnonzero(matte.ravel() == 0)) == 0).all()
