from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import ImageError
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.live.compositing.alpha_compositing import estimate_foreground_colors, over, unpremultiply

Pictures = tuple[np.ndarray, np.ndarray, np.ndarray]


@pytest.fixture
def pictures() -> Pictures:
    """A foreground, its alpha with clear, opaque and partial parts, and a background, 24 x 40."""
    random = np.random.default_rng(3)
    foreground, background = random.integers(0, 256, (2, 24, 40, 3), dtype=np.uint8)
    alpha = np.clip(random.uniform(-0.5, 1.5, (24, 40)), 0, 1).astype(np.float32)
    return foreground, alpha, background


def blended(foreground: np.ndarray, alpha: np.ndarray, background: np.ndarray) -> np.ndarray:
    """The definition, pixel by pixel in linear light, in float64."""
    front, back = (linear_from_uint8(picture).astype(np.float64) for picture in (foreground, background))
    return uint8_from_linear((back + alpha[..., None] * (front - back)).astype(np.float32))


def test_over_blends_in_linear_light(pictures: Pictures) -> None:
    assert np.abs(over(*pictures).astype(int) - blended(*pictures)).max() <= 1


def test_half_white_over_black_is_half_the_light_not_half_the_code() -> None:
    white, black = np.full((2, 2, 3), 255, np.uint8), np.zeros((2, 2, 3), np.uint8)
    assert over(white, np.full((2, 2), 0.5, np.float32), black)[0, 0, 0] == 188


def test_opaque_and_clear_pixels_are_copied_exactly(pictures: Pictures) -> None:
    foreground, alpha, background = pictures
    result = over(*pictures)
    np.testing.assert_array_equal(result[alpha == 1], foreground[alpha == 1])
    np.testing.assert_array_equal(result[alpha == 0], background[alpha == 0])


def test_over_leaves_its_inputs_alone(pictures: Pictures) -> None:
    before = [picture.copy() for picture in pictures]
    for picture in pictures:
        picture.setflags(write=False)
    over(*pictures)
    estimate_foreground_colors(*pictures[:2])
    for picture, copy in zip(pictures, before, strict=True):
        np.testing.assert_array_equal(picture, copy)


@pytest.mark.parametrize("at", [(0, 0), (3, 5), (-7, -4), (30, 20), (-40, 0), (0, -24), (60, 0), (0, 50), (-10, 9)])
def test_a_foreground_is_placed_and_cut_at_the_background_edges(pictures: Pictures, at: tuple[int, int]) -> None:
    foreground, alpha, _ = pictures
    background = np.full((33, 50, 3), 90, np.uint8)
    x, y = at
    wide_front, wide_alpha = np.zeros((133, 150, 3), np.uint8), np.zeros((133, 150), np.float32)
    wide_front[50 + y : 74 + y, 50 + x : 90 + x], wide_alpha[50 + y : 74 + y, 50 + x : 90 + x] = foreground, alpha
    expected = over(wide_front[50:83, 50:100], wide_alpha[50:83, 50:100], background)
    np.testing.assert_array_equal(over(foreground, alpha, background, at), expected)


def test_straight_undoes_premultiplication(pictures: Pictures) -> None:
    foreground, alpha, _ = pictures
    colours = linear_from_uint8(foreground)
    found = unpremultiply(colours * alpha[..., None], alpha)
    seen = alpha > 1 / 256
    np.testing.assert_allclose(found[seen], colours[seen], atol=2e-3)
    assert np.isfinite(found).all()


def test_warping_premultiplied_leaves_no_dark_rim() -> None:
    """A white disc over black, reduced premultiplied: over white it vanishes."""
    y, x = np.mgrid[:64, :64]
    alpha = (np.hypot(x - 31, y - 31) < 20).astype(np.float32)
    small = alpha.reshape(16, 4, 16, 4).mean(axis=(1, 3))
    colours = unpremultiply(np.repeat(small[..., None], 3, axis=2), small)
    white = np.full((16, 16, 3), 255, np.uint8)
    np.testing.assert_array_equal(over(uint8_from_linear(colours), small, white), white)


def test_foreground_colours_take_the_room_out_of_the_edge() -> None:
    """A person of one colour, mixed by a known alpha with a room of another, before a new background."""
    ramp = np.clip((np.arange(160) - 77) / 6, 0, 1).astype(np.float32)
    alpha = np.repeat(ramp[None], 90, axis=0)
    person, room, new = (np.full((90, 160, 3), colour, np.uint8) for colour in ((120, 60, 40), (250, 240, 200), 30))
    live, truth = over(person, alpha, room), over(person, alpha, new)
    plain = np.abs(over(live, alpha, new).astype(int) - truth).max()
    cleaned = np.abs(over(estimate_foreground_colors(live, alpha), alpha, new).astype(int) - truth).max()
    assert plain > 50
    assert cleaned <= 4


def test_a_matte_without_an_edge_changes_no_colour(pictures: Pictures) -> None:
    foreground = pictures[0]
    for value in (0, 1):
        result = estimate_foreground_colors(foreground, np.full(foreground.shape[:2], value, np.float32))
        np.testing.assert_array_equal(result, foreground)


def test_sizes_and_types_that_do_not_fit_are_refused(pictures: Pictures) -> None:
    foreground, alpha, background = pictures
    with pytest.raises(ImageError, match=r"alpha has shape \(23, 40\), but the foreground \(24, 40, 3\)"):
        over(foreground, alpha[1:], background)
    with pytest.raises(ImageError, match="background has shape"):
        over(foreground, alpha, background.astype(np.float32))
    with pytest.raises(ImageError, match="image has shape"):
        estimate_foreground_colors(foreground[..., 0], alpha)
