"""The warp looks where its affine map and its flow say, with pixel centres at integers + ½."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import ArrayLike

from relit_camera.base.images.image_types import Box
from relit_camera.live.reenactment.warp import FixedBorder, FlowPatch, Warp, sample_points

SIMILARITY = np.array([[0.7 * np.cos(0.3), -0.7 * np.sin(0.3), 36.0], [0.7 * np.sin(0.3), 0.7 * np.cos(0.3), -16.0]])
WHOLE = (0, 0, 320, 240)
REGION = np.array([40.0, 48.0, 200.0, 176.0])


def smooth_picture(height: int = 280, width: int = 360) -> np.ndarray:
    rng = np.random.default_rng(5)
    return cv2.GaussianBlur(rng.random((height, width, 4)).astype(np.float32), (0, 0), 6)


def looked_at(affine: np.ndarray, box: Box) -> np.ndarray:
    """Where each output pixel's centre looks in the still, in our coordinates: (height, width, 2)."""
    x, y = np.meshgrid(np.arange(box[0], box[2]) + 0.5, np.arange(box[1], box[3]) + 0.5)
    return np.stack([x, y], axis=2) @ affine[:, :2].T + affine[:, 2]


def patch_of(
    flow: Callable[[np.ndarray], np.ndarray], region: ArrayLike = REGION, rows: int = 65, columns: int = 81
) -> FlowPatch:
    box = np.asarray(region, dtype=np.float64)
    x, y = np.meshgrid(np.linspace(box[0], box[2], columns), np.linspace(box[1], box[3], rows))
    return FlowPatch(flow(np.stack([x, y], axis=2)).astype(np.float32), box)


def map_of(warp: Warp, box: Box, step: int = 4) -> np.ndarray:
    """Where each pixel of the box looks, (height, width, 2): what an image of the positions themselves shows there."""
    grid = warp.grid(box, step)
    fine = cv2.resize(grid.positions, None, fx=step, fy=step, interpolation=cv2.INTER_LINEAR)
    return np.asarray(fine[step : step + box[3] - box[1], step : step + box[2] - box[0]])


def well_inside(looks: np.ndarray, region: np.ndarray = REGION, margin: int = 32) -> np.ndarray:
    return np.asarray(((looks > region[:2] + margin) & (looks < region[2:] - margin)).all(axis=2))


def test_without_flow_it_is_cv2s_affine_warp() -> None:
    picture = smooth_picture()
    ours = Warp(SIMILARITY, ()).grid(WHOLE).sample(picture, beyond=cv2.BORDER_CONSTANT)
    for_cv2 = SIMILARITY.copy()
    for_cv2[:, 2] += SIMILARITY[:, :2] @ [0.5, 0.5] - 0.5
    theirs = cv2.warpAffine(picture, for_cv2, WHOLE[2:], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    seen = ((looked_at(SIMILARITY, WHOLE) > 2) & (looked_at(SIMILARITY, WHOLE) < [358, 278])).all(axis=2)
    np.testing.assert_allclose(ours[seen], theirs[seen], atol=1e-3)
    assert np.ptp(ours[seen]) > 0.05


def test_the_identity_gives_the_picture_back() -> None:
    picture = smooth_picture()
    same = Warp(np.eye(2, 3), ()).grid((0, 0, 360, 280)).sample(picture)
    np.testing.assert_allclose(same, picture, atol=1e-4)


@pytest.mark.parametrize("box", [WHOLE, (3, 5, 74, 58), (0, 0, 1, 1), (100, 50, 103, 240)])
def test_without_patches_positions_are_the_affine_ones(box: Box) -> None:
    np.testing.assert_allclose(map_of(Warp(SIMILARITY, ()), box), looked_at(SIMILARITY, box), atol=1e-3)


def test_beyond_the_still_there_is_nothing() -> None:
    grid = Warp(np.array([[1.0, 0, -30], [0, 1, 0]]), ()).grid((0, 0, 60, 20))
    view = grid.sample(np.ones((20, 20, 4), np.float32), beyond=cv2.BORDER_CONSTANT)
    assert view[:, :29].max() == 0
    np.testing.assert_allclose(view[:, 30:50], 1, atol=1e-4)
    assert view[:, 51:].max() == 0


def test_an_enlarged_still_is_sampled_in_the_same_places() -> None:
    """A ramp has the value of its position, whatever its size: half-pixel conventions hold on both sides."""
    x, y = np.meshgrid(np.arange(360) + 0.5, np.arange(280) + 0.5)
    ramp = np.stack([x, y], axis=2).astype(np.float32)
    large = np.asarray(cv2.resize(ramp, None, fx=3, fy=3, interpolation=cv2.INTER_LINEAR), np.float32)
    box = (80, 80, 270, 230)
    warp = Warp(SIMILARITY, (patch_of(lambda u: 0 * u + 3), patch_of(lambda u: 0 * u + 7, (90, 90, 130, 130))))
    np.testing.assert_allclose(warp.grid(box).sample(large, 3), map_of(warp, box), atol=0.02)


def test_a_box_is_a_part_of_the_whole() -> None:
    """Wherever the box begins; what is interpolated differs by a share of a pixel where the flow fades."""
    warp = Warp(SIMILARITY, (patch_of(lambda u: 0.1 * u - 10),))
    part, whole = map_of(warp, (13, 7, 253, 161)), map_of(warp, WHOLE)[7:161, 13:253]
    np.testing.assert_allclose(part, whole, atol=1.0)
    inside = well_inside(looked_at(SIMILARITY, (13, 7, 253, 161)))
    np.testing.assert_allclose(part[inside], whole[inside], atol=1e-2)


@pytest.mark.parametrize("affine", [np.array([[0.5, 0, 12.0], [0, 0.5, 20.0]]), SIMILARITY], ids=["plain", "turned"])
@pytest.mark.parametrize("fine", [False, True], ids=["head", "fine"])
def test_a_linear_flow_is_reproduced_inside_its_region(affine: np.ndarray, fine: bool) -> None:
    """Bilinear interpolation of a linear flow is exact; under the middle of the patch nothing of it fades."""
    bend = np.array([[0.1, -0.05], [0.02, -0.08]])
    patch = patch_of(lambda u: u @ bend.T + [2, -1])
    warp = Warp(affine, (patch_of(lambda u: 0 * u), patch) if fine else (patch,))
    looks = looked_at(affine, WHOLE)
    inside = well_inside(looks)
    expected = looks + looks @ bend.T + [2, -1]
    assert inside.sum() > 2000
    np.testing.assert_allclose(map_of(warp, WHOLE)[inside], expected[inside], atol=0.03)


def test_the_flow_fades_to_nothing_outside_its_region() -> None:
    warp, still = Warp(SIMILARITY, (patch_of(lambda u: u * 0 + 5),)), Warp(SIMILARITY, ())
    moved = map_of(warp, WHOLE) - map_of(still, WHOLE)
    looks = looked_at(SIMILARITY, WHOLE)
    outside = ((looks < REGION[:2] - 10) | (looks > REGION[2:] + 10)).any(axis=2)
    np.testing.assert_allclose(moved[outside], 0, atol=1e-3)
    np.testing.assert_allclose(moved[well_inside(looks)], 5, atol=1e-3)
    steps = [np.abs(np.diff(moved, axis=axis)).max() for axis in (0, 1)]
    assert max(steps) < 1  # no cliff


def test_a_later_patch_wins_where_it_is() -> None:
    warp = Warp(np.eye(2, 3), (patch_of(lambda u: u * 0 + 5), patch_of(lambda u: u * 0 - 2, (80, 80, 144, 144))))
    moved = map_of(warp, WHOLE) - map_of(Warp(np.eye(2, 3), ()), WHOLE)
    np.testing.assert_allclose(moved[96:128, 96:128], -2, atol=1e-3)
    np.testing.assert_allclose(moved[152:156, 80:150], 5, atol=1e-3)


def test_a_later_patch_keeps_its_detail() -> None:
    """Lids move within a few pixels: at a step that is small enough all of it is there."""

    def wave(u: np.ndarray):
        return 3 * np.sin(u[..., ::-1] / 2)

    region = np.array([80.0, 80, 144, 144])
    warp = Warp(np.eye(2, 3), (patch_of(lambda u: u * 0), patch_of(wave, region, 129, 129)))
    looks = looked_at(np.eye(2, 3), WHOLE)
    inside = well_inside(looks, region, 12)
    np.testing.assert_allclose(map_of(warp, WHOLE, 1)[inside], (looks + wave(looks))[inside], atol=0.1)


@pytest.mark.parametrize("box", [WHOLE, (3, 5, 74, 58), (0, 0, 1, 1), (100, 50, 103, 240)])
@pytest.mark.parametrize("step", [1, 3, 4])
def test_an_affine_grid_samples_every_pixel_of_its_box(box: Box, step: int) -> None:
    """The source shows each place's own position, so what is sampled is where each pixel looks."""
    x, y = np.meshgrid(np.arange(360) + 0.5, np.arange(280) + 0.5)
    ramp = np.stack([x, y], axis=2).astype(np.float32)
    sampled = Warp(SIMILARITY, ()).grid(box, step).sample(ramp)
    looks = looked_at(SIMILARITY, box)
    seen = ((looks > 1) & (looks < [359, 279])).all(axis=2)
    assert sampled.shape == looks.shape
    np.testing.assert_allclose(sampled[seen], looks[seen], atol=0.02)  # cv2 counts in 32nds


@pytest.mark.parametrize("count", [1, 64, 65, 70_000])
@pytest.mark.parametrize("beyond", [cv2.BORDER_REPLICATE, cv2.BORDER_CONSTANT])
def test_single_points_are_sampled_as_a_box_of_them_is(count: int, beyond: int) -> None:
    """However many there are, where OpenCV samples pictures of at most 32767 rows; and beyond the picture too."""
    grid = Warp(np.array([[1.3, 0.1, -9.0], [-0.1, 1.3, -7.0]]), ()).grid((0, 0, 280, 250), 1)
    picture = np.rint(255 * smooth_picture()).astype(np.uint8)
    large = cv2.resize(picture, None, fx=2, fy=2)
    sampled = sample_points(large, grid.nodes().reshape(-1, 2)[:count], 2, beyond)
    np.testing.assert_array_equal(sampled, grid.sample(large, 2, beyond).reshape(-1, 4)[:count])


def test_nodes_are_the_pixels_of_a_smaller_picture() -> None:
    grid = Warp(SIMILARITY, ()).grid((8, 4, 51, 36), 4)
    x, y = np.meshgrid(8 + 4 * (np.arange(11) + 0.5), 4 + 4 * (np.arange(8) + 0.5))
    expected = np.stack([x, y], axis=2) @ SIMILARITY[:, :2].T + SIMILARITY[:, 2]
    np.testing.assert_allclose(grid.nodes(), expected, atol=1e-3)


@pytest.mark.parametrize("channels", [(), (3,), (4,)])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_pictures_of_either_type_and_any_channels_are_sampled_alike(
    channels: tuple[int, ...], dtype: type[np.generic]
) -> None:
    picture = cv2.GaussianBlur(np.random.default_rng(5).random((280, 360, *channels)).astype(np.float32), (0, 0), 6)
    picture = (255 * picture).astype(dtype)
    box = (100, 90, 250, 200)
    warp = Warp(SIMILARITY, (patch_of(lambda u: 0.1 * u - 10),))
    sampled = warp.grid(box).sample(picture)
    assert sampled.dtype == dtype
    expected = warp.grid(box, 1).sample(picture)
    np.testing.assert_allclose(sampled.astype(float), expected.astype(float), atol=1.5)
    assert np.ptp(sampled) > 5


def test_a_still_border_holds_what_lies_there_and_leaves_the_middle_alone() -> None:
    patch = FlowPatch(np.full((41, 31, 2), 3, np.float32), np.array([-40.0, -30, 140, 180]))
    box, affine = (0, 0, 120, 170), np.array([[1.0, 0, -10], [0, 1, -10]])
    moved = map_of(Warp(affine, (patch, FixedBorder((100, 150)))), box, 1) - looked_at(affine, box)
    x, y = np.moveaxis(looked_at(affine, box), 2, 0)
    outside = (x <= 0) | (x >= 100) | (y <= 0) | (y >= 150)
    np.testing.assert_allclose(moved[outside], 0, atol=1e-5)
    inside = (np.abs(x - 50) < 30) & (np.abs(y - 75) < 50)
    np.testing.assert_allclose(moved[inside], 3, atol=1e-4)
    assert np.abs(np.diff(moved, axis=1)).max() < 1.0  # no cliff
