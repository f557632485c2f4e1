from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.live.compositing.alpha_compositing import over
from relit_camera.live.compositing.background_renderer import blur_background
from relit_camera.live.compositing.matted_frame import MattedFrame

HEIGHT, WIDTH = 240, 320


def room_with_person(person_colour: int) -> MattedFrame:
    """A green room with a person in the middle, whose colour and alpha end at a soft edge."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    alpha = np.rint(255 * np.clip((60 - np.hypot(x - 160, y - 130)) / 8 + 0.5, 0, 1)).astype(np.uint8)
    room = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    room[..., 1] = 40 + 100 * (x > 160)
    return MattedFrame(over(np.full_like(room, person_colour), alpha, room), alpha)


@pytest.mark.parametrize("strength", [0.15, 0.3, 1.0])
def test_nothing_of_the_person_bleeds_into_the_room(strength: float) -> None:
    """Whatever the person looks like, the blurred room is the same: white or black makes hardly a difference."""
    white, black = (linear_from_uint8(blur_background(room_with_person(colour), strength)) for colour in (255, 0))
    outside = room_with_person(0).matte == 0
    assert np.abs(white - black)[outside].max() < 0.04


def test_an_even_room_stays_even() -> None:
    person = room_with_person(0).matte
    even = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    result = blur_background(MattedFrame(over(np.full_like(even, 30), person, even), person), 0.4)
    assert np.abs(result[person < 128].astype(int) - 90).max() <= 2


@pytest.mark.parametrize("strength", [0.1, 0.25, 0.5, 1.0])
def test_an_empty_room_is_blurred_by_a_gaussian_of_that_sigma_in_linear_light(strength: float) -> None:
    random = np.random.default_rng(5)
    coarse = random.integers(0, 256, (6, 8, 3), dtype=np.uint8)
    image = cv2.resize(coarse, (960, 720), interpolation=cv2.INTER_NEAREST)
    found = linear_from_uint8(blur_background(MattedFrame(image, np.zeros((720, 960), np.uint8)), strength))
    expected = cv2.GaussianBlur(linear_from_uint8(image), (0, 0), 0.1 * strength * 720)
    assert np.abs(found - expected).max() < 0.03
    assert np.abs(found - expected).mean() < 0.005


def test_a_frame_full_of_person_still_gives_a_picture() -> None:
    image = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    result = blur_background(MattedFrame(image, np.full((HEIGHT, WIDTH), 255, np.uint8)), 0.5)
    assert result.shape == image.shape


@pytest.mark.parametrize(("radius", "kept"), [(2, 0.84), (4, 0.94), (8, 0.96)])
def test_small_lamps_keep_their_light(radius: int, kept: float) -> None:
    """Many, so that the blurred room is even: what they lose is that codes of neighbours are averaged, not light."""
    y, x = np.mgrid[:720, :960] % (12 * radius)
    lamps = np.clip(radius + 0.5 - np.hypot(x - 5.7 * radius, y - 6.2 * radius), 0, 1)[..., None].astype(np.float32)
    image = uint8_from_linear(np.repeat(0.03 + 0.97 * lamps, 3, axis=2))
    found = linear_from_uint8(blur_background(MattedFrame(image, np.zeros((720, 960), np.uint8)), 1.0))
    light = linear_from_uint8(image)
    assert kept < (found.mean() - light.min()) / (light.mean() - light.min()) < 1.02
