"""Noise is removed where a picture stands still, and nothing else is."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.app.demo import demo_files
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.temporal_noise import TemporalNoiseFilter
from relit_camera.base.video.video_readers import VideoReader

SIZE = (160, 120)
WHOLE = (0, 0, *SIZE)


def room() -> DisplayImage:
    """A picture (120, 160, 3) with colors and a texture."""
    random = np.random.default_rng(5)
    coarse = random.integers(60, 190, (6, 8, 3)).astype(np.uint8)
    picture = cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)
    return np.clip(picture + 8 * random.standard_normal(picture.shape), 0, 255).astype(np.uint8)


def noisy(picture: NDArray, sigma: float, seed: int) -> DisplayImage:
    noise = sigma * np.random.default_rng(seed).standard_normal(picture.shape)
    return np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8)


def settled(picture: DisplayImage, sigma: float = 3.0, frames: int = 20) -> TemporalNoiseFilter:
    """A filter that has seen a still picture for some frames."""
    noise_filter = TemporalNoiseFilter()
    for seed in range(frames):
        noise_filter.filtered(noisy(picture, sigma, seed), WHOLE)
    return noise_filter


@pytest.mark.parametrize("sigma", [1.5, 3.0, 6.0])
def test_a_still_picture_is_averaged(sigma: float) -> None:
    picture = room()
    noise_filter = settled(picture, sigma)
    live = [noisy(picture, sigma, seed) for seed in range(100, 130)]
    shown = [noise_filter.filtered(frame, WHOLE) for frame in live]

    def change(frames: list[DisplayImage]) -> float:
        return float(np.mean([np.abs(b.astype(float) - a).mean() for a, b in pairwise(frames)]))

    assert change(shown) < 0.4 * change(live)
    errors = np.mean([frame.astype(float) - picture for frame in shown], axis=0)
    rounding = 0.3  # of codes; the average has 0.45 sigma, and some windows are taken to move by chance
    assert np.sqrt(np.mean((shown[-1].astype(float) - picture) ** 2)) < 0.55 * sigma + rounding
    assert abs(errors.mean()) < 0.15  # no shift of brightness


def test_what_moves_is_shown_as_it_is() -> None:
    picture = room()
    noise_filter = settled(picture)
    for step in range(12):
        moved = picture.copy()
        moved[40:80, 20 + 8 * step : 40 + 8 * step] = (230, 40, 40)
        live = noisy(moved, 3, 50 + step)
        shown = noise_filter.filtered(live, WHOLE)
        trace = np.s_[44:76, 14 + 8 * step : 40 + 8 * step]  # where it is now, and where it was
        if step > 0:
            np.testing.assert_array_equal(shown[trace], live[trace])
        still = np.s_[90:, :]
        assert np.mean(shown[still] == live[still]) < 0.5


def test_a_light_that_is_switched_on_is_followed_at_once() -> None:
    picture = room()
    noise_filter = settled(picture)
    for seed in range(3):
        brighter = noisy(np.clip(picture + 6.0 * (seed + 1), 0, 255).astype(np.uint8), 3, 70 + seed)
        assert np.mean(noise_filter.filtered(brighter, WHOLE) == brighter) > 0.98


def test_a_shift_by_a_pixel_is_followed() -> None:
    """Of smooth shading it changes hardly more than noise does, but alike all over a window."""
    slope = np.broadcast_to(np.linspace(20, 235, SIZE[0])[None, :, None] * 1.0, (SIZE[1], SIZE[0], 3))
    noise_filter = TemporalNoiseFilter()
    for seed in range(20):
        noise_filter.filtered(noisy(slope, 2, seed), WHOLE)
    for step in range(1, 20):
        shifted = np.roll(slope, -2 * step, axis=1)
        shown = noise_filter.filtered(noisy(shifted, 2, 40 + step), WHOLE)
        inner = np.s_[:, 10 : SIZE[0] - 50]
        assert abs(float((shown[inner] - shifted[inner]).mean())) < 0.6  # averaged like noise it would trail by 5


def test_a_picture_without_noise_is_the_frame_itself() -> None:
    noise_filter = settled(room(), sigma=0.3)
    live = noisy(room(), 0.3, 99)
    assert noise_filter.filtered(live, WHOLE) is live


def test_outside_the_box_the_frame_is_shown() -> None:
    picture = room()
    noise_filter = settled(picture)
    live = noisy(picture, 3, 99)
    before = live.copy()
    shown = noise_filter.filtered(live, (40, 30, 120, 90))
    outside = np.ones(live.shape[:2], bool)
    outside[30:90, 40:120] = False
    np.testing.assert_array_equal(shown[outside], live[outside])
    assert np.mean(shown[~outside] == live[~outside]) < 0.5
    np.testing.assert_array_equal(live, before)  # it is given to others too


@pytest.mark.parametrize("box", [(0, 0, 0, 0), (10, 10, 12, 90), (0, 0, *SIZE)])
def test_frames_of_another_size_and_small_boxes_are_shown(box: tuple[int, int, int, int]) -> None:
    noise_filter = TemporalNoiseFilter()
    noise_filter.filtered(np.zeros((20, 30, 3), np.uint8), (0, 0, 30, 20))
    live = noisy(room(), 3, 1)
    assert noise_filter.filtered(live, box) is live
    assert noise_filter.filtered(live, box) is live  # no difference, or nothing to look at


def test_a_talking_and_turning_person_is_never_worse() -> None:
    """Each frame of the bundled clip with noise is nearer to the one without it."""
    noise_filter = TemporalNoiseFilter()
    with VideoReader(demo_files.CLIP) as frames:
        for frame in frames:
            if frame.index >= 60:
                break
            live = noisy(frame.image, 3, frame.index)
            shown = noise_filter.filtered(live, (0, 0, *frame.size))
            if frame.index > 0:
                truth = linear_from_uint8(frame.image)
                gain = psnr(linear_from_uint8(shown), truth) - psnr(linear_from_uint8(live), truth)
                assert gain > (2.0 if frame.index > 5 else 0.0)
