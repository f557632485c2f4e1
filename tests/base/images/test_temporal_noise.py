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


def settled(picture: NDArray, sigma: float = 3.0, frames: int = 20) -> TemporalNoiseFilter:
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
    rounding = 0.3  # of codes; the average has 0.45 sigma
    assert np.sqrt(np.mean((shown[-1].astype(float) - picture) ** 2)) < 0.5 * sigma + rounding
    assert abs(errors.mean()) < 0.15  # no shift of brightness


def test_what_moves_leaves_no_trail() -> None:
    picture = room()
    noise_filter = settled(picture)
    for step in range(12):
        moved = picture.copy()
        moved[40:80, 20 + 8 * step : 40 + 8 * step] = (230, 40, 40)
        shown = noise_filter.filtered(noisy(moved, 3, 50 + step), WHOLE)
        error = shown.astype(np.float32) - moved
        trace = np.s_[36:84, 8 + 8 * step : 44 + 8 * step]  # where it is now, and where it was
        assert np.abs(cv2.blur(error, (5, 5))[trace]).max() < 4
        assert error[90:].std() < (3.1 if step == 0 else 2)


def test_a_light_that_is_switched_on_is_followed_at_once() -> None:
    picture = room()
    noise_filter = settled(picture)
    for seed in range(3):
        brighter = noisy(np.clip(picture + 6.0 * (seed + 1), 0, 255).astype(np.uint8), 3, 70 + seed)
        assert np.mean(noise_filter.filtered(brighter, WHOLE) == brighter) > 0.98


def test_a_shift_by_less_than_a_pixel_is_followed() -> None:
    """Of smooth shading it changes less than noise does, but alike all over a window."""

    def waves(shift: float) -> NDArray[np.float64]:
        row = 128 + 100 * np.sin((np.arange(SIZE[0]) - shift) / 20)
        return np.broadcast_to(row[None, :, None], (SIZE[1], SIZE[0], 3))

    noise_filter = settled(waves(0))
    trails = []
    for step in range(1, 25):
        now = waves(0.4 * step)
        shown = noise_filter.filtered(noisy(now, 3, 40 + step), WHOLE)
        trails.append(float(((shown - now) * np.sign(now - waves(0.4 * step - 0.1))).mean()))
    # Averaged like noise it would trail by two frames: 2.5 codes.
    assert abs(np.mean(trails[8:])) < 1.0


def test_a_thin_line_leaves_no_trail() -> None:
    picture = np.full((SIZE[1], SIZE[0], 3), 160, np.uint8)
    noise_filter = settled(picture)
    for step in range(15):
        moved, column = picture.copy(), 20 + 3 * step
        moved[:, column] = 60
        shown = noise_filter.filtered(noisy(moved, 3, 50 + step), WHOLE).astype(float)
        assert shown[:, column].mean() < 70
        assert abs(shown[:, column - 3].mean() - 160) < 5


def test_what_moves_in_color_alone_leaves_no_trail() -> None:
    picture = np.broadcast_to(np.array([90, 110, 90], np.uint8), (SIZE[1], SIZE[0], 3))
    noise_filter = settled(picture)
    for step in range(8):
        moved = picture.copy()
        left = 10 + 12 * step
        moved[40:80, left : left + 30] = (190, 110, 90)
        shown = noise_filter.filtered(noisy(moved, 3, 50 + step), WHOLE).astype(float)
        assert abs(shown[40:80, left : left + 30, 0].mean() - 190) < 2
        if step > 0:
            assert abs(shown[40:80, left - 12 : left, 0].mean() - 90) < 5


@pytest.mark.parametrize("times", [2, 3])
def test_a_webcam_that_repeats_its_frames_loses_its_noise_as_well(times: int) -> None:
    picture, noise_filter = room(), TemporalNoiseFilter()
    for index in range(90):
        shown = noise_filter.filtered(noisy(picture, 3, index // times), WHOLE)
        if index > 40:
            assert np.sqrt(np.mean((shown.astype(float) - picture) ** 2)) < 0.65 * 3


def test_a_picture_that_has_no_noise_at_all_is_not_copied() -> None:
    noise_filter = TemporalNoiseFilter()
    for _ in range(12):
        live = room()
        assert noise_filter.filtered(live, WHOLE) is live


def test_a_frame_that_freezes_and_goes_on_is_averaged_all_along() -> None:
    picture, noise_filter = room(), settled(room())
    for index in range(40):
        shown = noise_filter.filtered(noisy(picture, 3, 100 + max(index - 15, 0)), WHOLE)
        assert np.sqrt(np.mean((shown.astype(float) - picture) ** 2)) < 0.65 * 3


@pytest.mark.parametrize("code", [0, 255])
def test_a_black_or_white_part_does_not_hide_the_noise_of_the_rest(code: int) -> None:
    picture = room()
    picture[:, :60] = code
    noise_filter = settled(picture)
    live = noisy(picture, 3, 99)
    shown = noise_filter.filtered(live, WHOLE)
    assert np.sqrt(np.mean((shown[:, 70:].astype(float) - picture[:, 70:]) ** 2)) < 0.65 * 3


@pytest.mark.slow
def test_noise_that_is_hardly_there_is_removed_always_or_never() -> None:
    """Else it would come and go."""
    picture = room()
    for sigma in np.arange(0.8, 1.6, 0.1):
        noise_filter = settled(picture, sigma, 60)
        removed = [
            not np.array_equal(noise_filter.filtered(live, WHOLE), live)
            for live in (noisy(picture, sigma, seed) for seed in range(200, 320))
        ]
        assert np.mean(removed) in (0, 1), sigma


def test_after_another_size_the_noise_is_measured_anew() -> None:
    noise_filter = settled(room(), sigma=1.2)
    small = room()[:100, :120]
    for seed in range(30):
        live = noisy(small, 3, seed)
        shown = noise_filter.filtered(live, (0, 0, 120, 100))
    assert np.sqrt(np.mean((shown.astype(float) - small) ** 2)) < 0.65 * 3


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
    errors = shown[~outside].astype(float) - picture[~outside]
    assert np.sqrt(np.mean(errors**2)) < 0.65 * 3
    np.testing.assert_array_equal(live, before)  # it is given to others too


@pytest.mark.parametrize("box", [(0, 0, 0, 0), (10, 10, 12, 90), (0, 0, *SIZE)])
def test_frames_of_another_size_and_small_boxes_are_shown(box: tuple[int, int, int, int]) -> None:
    noise_filter = TemporalNoiseFilter()
    noise_filter.filtered(np.zeros((20, 30, 3), np.uint8), (0, 0, 30, 20))
    live = noisy(room(), 3, 1)
    assert noise_filter.filtered(live, box) is live
    assert noise_filter.filtered(live, box) is live  # no difference, or nothing to look at


@pytest.mark.slow
def test_a_talking_and_turning_person_is_shown_better_in_each_frame() -> None:
    """Each frame of the bundled clip with noise is nearer to the one without it than it was."""
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
                assert gain > (3.0 if frame.index > 5 else -0.01)
