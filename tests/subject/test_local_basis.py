"""Local bases: their sums against the definition written out, and what does not fit together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.subject.compression.local_basis import LocalBasis, global_basis
from tests.subject.handmade_basis import rows_by_hand

PIXELS = 30


@pytest.fixture(scope="module")
def basis() -> LocalBasis:
    """Three clusters of unequal rank; the second repeats a pixel, and some pixels are in none."""
    rng = np.random.default_rng(0)
    pixels = rng.permutation(PIXELS)[:15].reshape(3, 5).astype(np.int32)
    pixels[1, 4] = pixels[1, 3]
    values = rng.integers(-127, 128, (9, 3, 5)).astype(np.int8)
    values[2:7, :, 4] = values[2:7, :, 3]
    mixes = rng.normal(0, 0.3, (9, 4)).astype(np.float16)
    return LocalBasis(pixels, np.array([0, 2, 7, 9], np.int32), values, rng.random(9, np.float32) / 127, mixes)


def test_colours_of_any_pixels_in_any_order(basis: LocalBasis) -> None:
    amounts = np.random.default_rng(1).normal(size=(4, 6)).astype(np.float32)
    pixels = np.random.default_rng(2).permutation(PIXELS)[:20]
    expected = rows_by_hand(basis, PIXELS)[pixels] @ amounts
    np.testing.assert_allclose(basis.at(amounts, pixels), expected.transpose(2, 0, 1), atol=1e-5)


def test_a_cluster_without_components_is_black(basis: LocalBasis) -> None:
    more = replace(basis, pixels=np.vstack([basis.pixels, [29] * 5]), first=np.append(basis.first, 9).astype(np.int32))
    pixels = np.array([[29, 29]])
    assert not more.rows(pixels, np.ones((1, 2))).any()
    assert not more.at(np.ones((4, 1), np.float32), pixels[0, :1]).any()


def test_weighted_sums_of_rows_count_a_repeated_place_once_and_a_repeated_pixel_twice(basis: LocalBasis) -> None:
    rng = np.random.default_rng(3)
    pixels, weights = rng.integers(0, PIXELS, (7, 12)), rng.random((7, 12))
    assert len(set(pixels[0].tolist())) < 12
    expected = np.einsum("si,sicg->csg", weights, rows_by_hand(basis, PIXELS)[pixels])
    np.testing.assert_allclose(basis.rows(pixels, weights), expected, atol=1e-5)


def test_inner_products_of_the_shared_pictures(basis: LocalBasis) -> None:
    rows = rows_by_hand(basis, PIXELS)
    np.testing.assert_allclose(basis.gram(), np.einsum("pcg,pch->gh", rows, rows), atol=1e-4)


def test_a_whole_basis_is_the_pictures_inside_the_matte() -> None:
    pictures = np.random.default_rng(5).normal(size=(3, 4, 6, 5)).astype(np.float16)
    matte = (np.random.default_rng(6).random((6, 5)) < 0.6).astype(np.float32)
    rows = rows_by_hand(global_basis(pictures, matte), 30).reshape(6, 5, 3, 4)
    np.testing.assert_array_equal(rows, pictures.transpose(2, 3, 0, 1) * matte[..., None, None])


@pytest.mark.parametrize(
    "wrong",
    [
        {"first": np.array([0, 2, 7], np.int32)},
        {"first": np.array([0, 7, 2, 9], np.int32)},
        {"first": np.array([0, 2, 7, 8], np.int32)},
        {"scales": np.ones(8, np.float32)},
        {"values": np.zeros((9, 3, 4), np.int8)},
        {"pixels": np.full((3, 5), -1, np.int32)},
    ],
    ids=["clusters", "order", "count", "scales", "places", "negative"],
)
def test_arrays_that_do_not_fit_together_are_refused(basis: LocalBasis, wrong: dict[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match=r"shape|bounds|negative"):
        replace(basis, **wrong)
