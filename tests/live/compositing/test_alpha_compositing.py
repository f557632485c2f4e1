from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import ImageError
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.live.compositing.alpha_compositing import over, replace_room, split_alpha
from relit_camera.live.compositing.matted_frame import MattedFrame

Pictures = tuple[np.ndarray, np.ndarray, np.ndarray]


@pytest.fixture
def pictures() -> Pictures:
    """A foreground, its alpha with clear, opaque and partial parts, and a background, 24 x 40."""
    random = np.random.default_rng(3)
    foreground, background = random.integers(0, 256, (2, 24, 40, 3), dtype=np.uint8)
    alpha = np.clip(random.integers(-128, 384, (24, 40)), 0, 255).astype(np.uint8)
    return foreground, alpha, background


def blended(foreground: np.ndarray, alpha: np.ndarray, background: np.ndarray) -> np.ndarray:
    """The definition, pixel by pixel in linear light, in float64."""
    front, back = (linear_from_uint8(picture).astype(np.float64) for picture in (foreground, background))
    return uint8_from_linear((back + alpha[..., None] / 255 * (front - back)).astype(np.float32))


def test_over_blends_in_linear_light(pictures: Pictures) -> None:
    assert np.abs(over(*pictures).astype(int) - blended(*pictures)).max() <= 1


def test_half_white_over_black_is_half_the_light_not_half_the_code() -> None:
    white, black = np.full((2, 2, 3), 255, np.uint8), np.zeros((2, 2, 3), np.uint8)
    assert over(white, np.full((2, 2), 128, np.uint8), black)[0, 0, 0] == 188


def test_opaque_and_clear_pixels_are_copied_exactly(pictures: Pictures) -> None:
    foreground, alpha, background = pictures
    result = over(*pictures)
    np.testing.assert_array_equal(result[alpha == 255], foreground[alpha == 255])
    np.testing.assert_array_equal(result[alpha == 0], background[alpha == 0])


def test_over_leaves_its_inputs_alone(pictures: Pictures) -> None:
    before = [picture.copy() for picture in pictures]
    for picture in pictures:
        picture.setflags(write=False)
    over(*pictures)
    foreground, alpha, background = pictures
    replace_room(MattedFrame(foreground, alpha), background)
    for picture, copy in zip(pictures, before, strict=True):
        np.testing.assert_array_equal(picture, copy)


@pytest.mark.parametrize("at", [(0, 0), (3, 5), (-7, -4), (30, 20), (-40, 0), (0, -24), (60, 0), (0, 50), (-10, 9)])
def test_a_foreground_is_placed_and_cut_at_the_background_edges(pictures: Pictures, at: tuple[int, int]) -> None:
    foreground, alpha, _ = pictures
    background = np.full((33, 50, 3), 90, np.uint8)
    x, y = at
    wide_front, wide_alpha = np.zeros((133, 150, 3), np.uint8), np.zeros((133, 150), np.uint8)
    wide_front[50 + y : 74 + y, 50 + x : 90 + x], wide_alpha[50 + y : 74 + y, 50 + x : 90 + x] = foreground, alpha
    expected = over(wide_front[50:83, 50:100], wide_alpha[50:83, 50:100], background)
    np.testing.assert_array_equal(over(foreground, alpha, background, at), expected)


def test_replacing_the_room_takes_it_out_of_the_edge() -> None:
    """A person of one colour, mixed by a known alpha with a room of another, before a new background."""
    ramp = np.clip((np.arange(160) - 77) / 6, 0, 1)
    alpha = np.repeat(np.rint(255 * ramp[None]), 90, axis=0).astype(np.uint8)
    person, room, new = (np.full((90, 160, 3), colour, np.uint8) for colour in ((120, 60, 40), (250, 240, 200), 30))
    live, truth = over(person, alpha, room), over(person, alpha, new)
    plain = np.abs(over(live, alpha, new).astype(int) - truth).max()
    cleaned = np.abs(replace_room(MattedFrame(live, alpha), new).astype(int) - truth).max()
    assert plain > 50
    assert cleaned <= 4


def test_a_matte_that_is_too_wide_leaves_no_light_rim_of_a_bright_room() -> None:
    """The network's mattes are soft: what has the room's colour there is room."""
    true = np.repeat(np.rint(255 * np.clip((np.arange(160) - 79) / 2, 0, 1))[None], 90, axis=0).astype(np.uint8)
    wide = np.repeat(np.rint(255 * np.clip((np.arange(160) - 74) / 10, 0, 1))[None], 90, axis=0).astype(np.uint8)
    person, room, new = (np.full((90, 160, 3), colour, np.uint8) for colour in ((120, 60, 40), (250, 240, 200), 0))
    live, truth = over(person, true, room), over(person, true, new).astype(int)
    cleaned = np.abs(replace_room(MattedFrame(live, wide), new).astype(int) - truth).max()
    assert np.abs(over(live, wide, new).astype(int) - truth).max() > 150
    assert cleaned < 80, "121 without what the colours tell"


@pytest.mark.parametrize("size", [(1920, 1080), (1280, 720), (405, 301), (301, 405), (160, 90)])
def test_the_colours_of_an_edge_are_those_beside_it(size: tuple[int, int]) -> None:
    """Person and room that change over the picture: each place of the edge finds its own, at any size."""
    width, height = size
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    alpha = np.rint(255 * np.clip((0.6 - y) * 40, 0, 1)).astype(np.uint8)
    person = np.dstack([60 + 120 * x, 90 - 40 * x, 50 + 0 * x]).astype(np.uint8)
    room, new = np.full_like(person, 210), np.full_like(person, 20)
    truth = over(person, alpha, new)
    cleaned = replace_room(MattedFrame(over(person, alpha, room), alpha), new).astype(int) - truth
    assert np.abs(cleaned).max() <= 12
    assert np.abs(cleaned).mean() < 0.5


def test_a_matte_without_an_edge_copies(pictures: Pictures) -> None:
    foreground, _, background = pictures
    for value, expected in ((0, background), (255, foreground)):
        result = replace_room(MattedFrame(foreground, np.full(foreground.shape[:2], value, np.uint8)), background)
        np.testing.assert_array_equal(result, expected)
        assert not np.shares_memory(result, expected)


def test_alpha_is_split_off() -> None:
    image = np.random.default_rng(2).integers(0, 256, (5, 7, 4), dtype=np.uint8)
    colors, alpha = split_alpha(image)
    np.testing.assert_array_equal(np.dstack([colors, alpha]), image)


def test_sizes_and_types_that_do_not_fit_are_refused(pictures: Pictures) -> None:
    foreground, alpha, background = pictures
    with pytest.raises(ImageError, match=r"alpha is uint8 \(23, 40\), but the foreground \(24, 40, 3\)"):
        over(foreground, alpha[1:], background)
    with pytest.raises(ImageError, match="background has shape"):
        over(foreground, alpha, background.astype(np.float32))
    with pytest.raises(ImageError, match="alpha is float32"):
        over(foreground, alpha.astype(np.float32), background)
    with pytest.raises(ImageError, match="image has shape"):
        replace_room(MattedFrame(foreground[..., 0], alpha), background)
    with pytest.raises(ImageError, match="but the background"):
        replace_room(MattedFrame(foreground, alpha), background[1:])
