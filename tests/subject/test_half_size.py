"""The subject at half its size: it is relit as the means of the whole one's pixels are."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from relit_camera.base.images.image_quality import psnr
from relit_camera.lab.bench.synthetic_subject import synthetic_subject
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.subject.half_size import half_size_basis, half_size_subject
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject


def relit(subject: Subject) -> np.ndarray:
    return BasisRelighter(subject).relight(builtin_light_map("sunset")[None])[0]


@pytest.mark.slow
@pytest.mark.parametrize("size", [(64, 48), (63, 49)])
def test_it_is_relit_as_the_means_of_its_pixels_are(size: tuple[int, int]) -> None:
    whole = synthetic_subject(*size)
    half = half_size_subject(whole)
    width, height = (-(-side // 2) for side in size)
    assert half.size == (width, height)
    assert (half.matte.shape, half.neutral.shape) == ((height, width), (height, width, 3))
    even = np.pad(relit(whole), ((0, size[1] % 2), (0, size[0] % 2), (0, 0)), "edge")
    expected = cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)
    inside = cv2.erode((half.matte == 1).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    assert inside.any()
    assert psnr(relit(half)[inside], expected[inside]) > 40  # blocks of several clusters have some of their pixels
    for scheme, points in half.landmarks.items():
        np.testing.assert_allclose(points, whole.landmarks[scheme] / 2)


@pytest.mark.slow
def test_each_block_with_a_pixel_has_one_row_and_no_other_has() -> None:
    whole = synthetic_subject(40, 32)
    basis = half_size_basis(whole.basis, whole.size)
    pixels = np.unique(whole.basis.pixels)
    blocks = np.unique(pixels // 40 // 2 * 20 + pixels % 40 // 2)
    np.testing.assert_array_equal(np.unique(basis.pixels), blocks)
    owners = [np.unique(cluster) for cluster in basis.pixels]
    assert sum(map(len, owners)) == len(blocks)
    assert basis.values.dtype == whole.basis.values.dtype


@pytest.mark.slow
def test_a_cluster_that_is_the_largest_nowhere_is_left_out() -> None:
    whole = synthetic_subject(32, 32)
    basis, (count, places) = whole.basis, whole.basis.pixels.shape
    lonely = np.full((1, places), basis.pixels[0, 0], np.int32)  # its block has more pixels of the first cluster
    components = int(basis.first[1])
    more = replace(
        basis,
        pixels=np.concatenate([basis.pixels, lonely]),
        first=np.append(basis.first, basis.first[-1] + components).astype(np.int32),
        values=np.concatenate([basis.values, basis.values[:components]]),
        scales=np.concatenate([basis.scales, basis.scales[:components]]),
        mixes=np.concatenate([basis.mixes, basis.mixes[:components]]),
    )
    assert len(half_size_basis(more, whole.size).pixels) <= count
