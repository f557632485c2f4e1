"""The person cut out of the still: soft edges, and picture and matte that go together."""

from __future__ import annotations

import dataclasses

import numpy as np

from relit_camera.live.reenactment.source_image import Cutout, feather_edges, shows_whole_head
from relit_camera.live.reenactment.warp import Warp
from tests.live.people import close_up, person


def with_edges(over_black: bool):
    """The small person, said to be taken over black or not."""
    subject = person()
    return dataclasses.replace(subject, metadata=subject.metadata.model_copy(update={"over_black": over_black}))


def unmoved(cutout: Cutout, relit: np.ndarray):
    """Picture and alpha of the still as it lies."""
    return cutout.sampled(relit, Warp(np.eye(2, 3), ()).grid((0, 0, relit.shape[1], relit.shape[0])))


def test_a_cut_out_person_is_premultiplied() -> None:
    subject = with_edges(over_black=False)
    relit = np.full((*subject.matte.shape, 3), 0.5, np.float32)
    picture, alpha = unmoved(Cutout(subject), relit)
    assert picture.dtype == alpha.dtype == np.float32
    np.testing.assert_allclose(alpha, feather_edges(subject.matte), atol=0.06)
    np.testing.assert_allclose(picture, 0.5 * np.repeat(alpha[..., None], 3, axis=2), atol=0.01)


def test_frames_taken_over_black_carry_the_matte_already() -> None:
    """Their soft edge is the person times the matte: it is not darkened a second time."""
    subject = with_edges(over_black=True)
    captured = np.repeat(0.5 * subject.matte[..., None], 3, axis=2)
    picture, alpha = unmoved(Cutout(subject), captured)
    np.testing.assert_allclose(picture, 0.5 * np.repeat(alpha[..., None], 3, axis=2), atol=0.03)


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
