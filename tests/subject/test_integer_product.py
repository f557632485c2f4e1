"""Products in 8-bit integers agree with the same products of floats."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.relighting.basis_relighter import groups_by_rank, in_8_bits
from relit_camera.subject.relighting.integer_product import CHANNEL_STEPS, ClusterProducts, IntegerProduct
from tests.subject.handmade_basis import rows_by_hand


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    """Root mean square error as a share of the root mean square."""
    return float(np.sqrt(((found - expected) ** 2).mean() / (expected**2).mean()))


@pytest.mark.parametrize(("columns", "allowed"), [(20, 2e-4), (64, 2e-4), (300, 2e-3)])
def test_a_large_matrix(columns: int, allowed: float) -> None:
    """As a subject's: the first columns are the largest, and so are their factors."""
    rng = np.random.default_rng(columns)
    fading = np.exp(-np.arange(columns) / 40).astype(np.float32)
    matrix = rng.standard_normal((500, columns), np.float32) * fading
    factors = rng.standard_normal((6, columns), np.float32) * fading * np.float32(1e4)
    product = IntegerProduct(500, columns, np.split(matrix, [100, 130]))
    expected = factors.astype(np.float64) @ matrix.T
    assert relative_error(product(factors), expected) < allowed
    assert relative_error(product(factors[:1] * 1e-9), expected[:1] * 1e-9) < allowed
    assert product.nbytes <= 500 * (columns + 256 + 12)
    assert not product(np.zeros((3, columns), np.float32)).any()


def test_the_largest_codes_and_digits_do_not_overflow() -> None:
    """Where bytes are added in pairs within 16 bits, full digits times full codes would be clipped."""
    signs = np.random.default_rng(5).choice([-1, 1], (3, 256)).astype(np.float32)
    for factors in (signs, np.ones((2, 256), np.float32)):
        np.testing.assert_allclose(IntegerProduct(3, 256, [signs])(factors), factors @ signs.T, rtol=2e-4, atol=0.1)


def test_clusters_of_several_ranks() -> None:
    rng = np.random.default_rng(1)
    groups = [rng.integers(-127, 128, (n, 3, rank, 150)).astype(np.int8) for n, rank in ((4, 8), (1, 24), (7, 32))]
    count = sum(len(values) * values.shape[2] for values in groups)
    amounts = rng.standard_normal((3, 2, count), np.float32)
    products = ClusterProducts(groups)
    found = products(amounts)
    assert found.shape == (2, products.size + 1)
    assert not found[:, -1].any()
    start = 0
    for values, positions in zip(groups, products.positions(), strict=True):
        end = start + len(values) * values.shape[2]
        part = amounts[:, :, start:end].reshape(3, 2, len(values), -1)
        expected = np.einsum("clkr,kcrp->lkpc", part, values.astype(np.float64))
        places = positions[..., None] + np.array(CHANNEL_STEPS)
        assert relative_error(found[:, places], expected) < 2e-4
        start = end


def test_the_largest_codes_and_digits_of_a_cluster_do_not_overflow() -> None:
    """Nor of one as large as a basis that all pixels share, whose sums leave 32 bits once the digits are together."""
    rank = 4200
    signs = np.random.default_rng(6).choice([-1, 1], (1, 3, rank, 10)).astype(np.int8)
    found = ClusterProducts([signs * np.int8(127)])(
        np.ascontiguousarray(signs[:, :, :, 0].transpose(1, 0, 2), np.float32)
    )
    np.testing.assert_allclose(found[0, :1], 127 * rank, rtol=2e-4)


def test_missing_rows_of_a_matrix_are_no_rows() -> None:
    with pytest.raises(ValueError, match="2 of 3 rows"):
        IntegerProduct(3, 8, [np.ones((2, 8), np.float32)])


def test_a_basis_of_half_floats_in_8_bits() -> None:
    rng = np.random.default_rng(2)
    pixels = np.arange(20, dtype=np.int32).reshape(2, 10)
    first, mixes = np.array([0, 2, 5], np.int32), rng.standard_normal((5, 4)).astype(np.float16)
    values = (rng.standard_normal((5, 3, 10)) ** 3).astype(np.float16)
    basis = LocalBasis(pixels, first, values, rng.random(5, np.float32), mixes)
    rounded = in_8_bits(basis)
    assert rounded.values.dtype == np.int8
    assert relative_error(rows_by_hand(rounded, 20), rows_by_hand(basis, 20)) < 1e-4
    assert in_8_bits(rounded) is rounded
    assert [group.values.shape[:3] for group in groups_by_rank(rounded)] == [(2, 3, 8)]
