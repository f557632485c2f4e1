"""The person cut out of the still: soft edges, and picture and matte that go together."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.live.compositing.alpha_compositing import over, split_alpha
from relit_camera.live.reenactment.source_image import (
    COLORED,
    UPSAMPLING,
    Cutout,
    feather_edges,
    fill_pinholes,
    shows_whole_head,
)
from relit_camera.live.reenactment.warp import Warp, source_from_output
from tests.live.people import close_up, person


def with_edges(over_black: bool):
    """The small person, said to be taken over black or not."""
    subject = person()
    return dataclasses.replace(subject, metadata=subject.metadata.model_copy(update={"over_black": over_black}))


def unmoved(cutout: Cutout, relit: np.ndarray):
    """Colours and alpha of the still as it lies."""
    grid = Warp(np.eye(2, 3), ()).grid((0, 0, relit.shape[1], relit.shape[0]))
    return split_alpha(cutout.warped(cutout.image(relit), grid))


HALF_LIGHT = display_from_linear(np.full((1, 1, 3), 0.5, np.float32))[0, 0]


def test_a_cut_out_person_is_straight_and_has_color_beyond_the_edge() -> None:
    subject = with_edges(over_black=False)
    relit = np.full((*subject.matte.shape, 3), 0.5, np.float32)
    relit[subject.matte < 0.05] = 0.0  # what stood behind
    colors, alpha = unmoved(Cutout(subject), relit)
    assert colors.dtype == alpha.dtype == np.uint8
    np.testing.assert_allclose(alpha / 255, feather_edges(subject.matte), atol=0.06)
    assert np.abs(colors[alpha > 0].astype(int) - HALF_LIGHT).max() <= 1


def test_frames_taken_over_black_give_back_the_matte() -> None:
    """Their soft edge is the person times the matte: without it the person has one colour to the very edge."""
    subject = with_edges(over_black=True)
    captured = np.repeat(0.5 * subject.matte[..., None], 3, axis=2)
    colors, alpha = unmoved(Cutout(subject), captured)
    assert np.abs(colors[alpha > 0].astype(int) - HALF_LIGHT).max() <= 1


def test_an_edge_darker_than_its_matte_says_has_the_colors_next_to_it() -> None:
    """Pictures cut out in an editor have the matte as a factor of their codes, so that of their light is smaller."""
    subject = with_edges(over_black=True)
    captured = np.repeat(0.5 * subject.matte[..., None] ** 2, 3, axis=2)
    colors, alpha = unmoved(Cutout(subject), captured)
    darkest = display_from_linear(np.full((1, 1, 3), 0.5 * COLORED, np.float32))  # of pixels that count
    assert colors[alpha > 0].min() >= darkest.min()
    assert colors.max() <= HALF_LIGHT.max() + 1


def test_an_edge_over_another_background_is_as_a_finer_rendering_has_it() -> None:
    """A shaded disc at a third of the size and over black, enlarged again: no dark rim over white, none over grey."""
    subject = with_edges(over_black=True)
    width, height = 3 * subject.size[0], 3 * subject.size[1]
    y, x = (np.mgrid[:height, :width] + 0.5) / width - np.array([2 / 3, 0.5])[:, None, None]
    alpha = np.clip((0.3 - np.hypot(x, y)) * width / 2 + 0.5, 0, 1).astype(np.float32)
    colors = (0.3 + 0.2 * np.dstack([x, y, x + y])).astype(np.float32)
    matte, picture = (
        cv2.resize(p, subject.size, interpolation=cv2.INTER_AREA) for p in (alpha, colors * alpha[..., None])
    )
    cutout = Cutout(dataclasses.replace(subject, matte=matte))
    grid = Warp(source_from_output(subject.size, (width, height)), ()).grid((0, 0, width, height))
    found, found_alpha = split_alpha(cutout.warped(cutout.image(picture), grid))
    exact = np.rint(alpha * 255).astype(np.uint8)
    for behind in (0, 60, 255):
        background = np.full((height, width, 3), behind, np.uint8)
        truth = over(display_from_linear(colors), exact, background)
        # The same alpha, so that only the colors count; half a code of the reduced picture is a code here.
        assert np.abs(over(found, exact, background).astype(int) - truth).max() <= 4
        assert np.abs(over(found, found_alpha, background).astype(int) - truth).mean() < 1


def test_a_person_without_a_single_sure_pixel_is_no_trouble() -> None:
    subject = dataclasses.replace(person(), matte=np.full_like(person().matte, 0.3))
    relit = np.full((*subject.matte.shape, 3), 0.5, np.float32)
    colors, _ = unmoved(Cutout(subject), relit)
    assert np.abs(colors.astype(int) - HALF_LIGHT).max() <= 1


def test_what_the_cutout_leaves_out_cannot_be_seen() -> None:
    """Only the cells that show the person are sampled: the rest of a full sampling is clear."""
    subject = with_edges(over_black=False)
    cutout = Cutout(subject)
    relit = np.random.default_rng(1).random((*subject.matte.shape, 3)).astype(np.float32)
    for scale in (0.6, 1.0, 3.1):
        size = (round(96 * scale), round(128 * scale))
        grid = Warp(source_from_output(subject.size, size), ()).grid((0, 0, *size))
        cut, whole = cutout.warped(cutout.image(relit), grid), grid.sample(cutout.image(relit), UPSAMPLING)
        left_out = (cut != whole).any(axis=2)
        assert left_out.mean() > 0.02
        assert whole[left_out, 3].max() == 0


def test_holes_of_a_few_pixels_are_filled_and_larger_ones_and_hairs_are_not() -> None:
    matte = np.zeros((200, 200), np.float32)
    matte[40:, 40:160] = 1
    matte[80:83, 60:62], matte[81, 63] = 0.1, 0.95  # between hair and ear
    matte[120:140, 90:110] = 0  # an arm
    matte[20:40, 50] = matte[20:40, 53] = 0.7  # two hairs, and a third across them
    matte[20, 50:54] = 0.7
    filled = fill_pinholes(matte)
    expected = matte.copy()
    expected[80:83, 60:64] = 1
    np.testing.assert_array_equal(filled, expected)


def test_who_is_seen_whole() -> None:
    assert shows_whole_head(person().matte)
    assert not shows_whole_head(close_up().matte)


def test_feathered_fades_at_sides_and_top_and_not_at_the_bottom() -> None:
    matte = feather_edges(np.ones((100, 200), np.float32))
    assert matte.dtype == np.float32
    assert matte[:, [0, -1]].max() < 0.02
    assert matte[0].max() < 0.02
    assert matte[-1, 20:-20].min() == 1
    assert matte[20:, 20:-20].min() == 1
    np.testing.assert_allclose(matte, matte[:, ::-1], atol=1e-6)
    ours = person().matte
    assert (feather_edges(ours) <= ours + 1e-6).all()
