"""Highlights found in crops of a film, against the ball's geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.specular_highlight import BallCrops, Highlight, NoHighlight
from relit_camera.capture.film.ball.sphere_projection import PinholeView
from tests.capture.film.ball.mirror_scene import (
    MirrorScene,
    degrees_between,
    hand_path,
    highlight_in,
    true_normal,
    view_of,
)

LAMPS = hand_path(2, 100.0, np.array([0.0, -2.0, -58.0]))
SMALL = MirrorScene()
LARGE = MirrorScene((420, 400), 900.0, np.array([0.5, 0.4, -60.0]), 5.5, lamp_radius_cm=2.0, noise=0.002)


def kept(view: PinholeView, frames: list[LinearImage]) -> BallCrops:
    film = BallCrops(view.outline, view.size)
    for index, frame in enumerate(frames):
        film.add(index, frame)
    return film


@pytest.mark.slow
@pytest.mark.parametrize("scene", [SMALL, LARGE], ids=["small", "large"])
def test_a_crop_gives_the_same_highlight_as_the_whole_frame(scene: MirrorScene) -> None:
    frames = [scene.photograph(lamp, seed=n) for n, lamp in enumerate([None, *LAMPS])]
    view = view_of(scene)
    found = kept(view, frames).highlights(range(1, 1 + len(LAMPS)), lambda index: view)
    for index, lamp in enumerate(LAMPS, 1):
        here, whole = found[index], highlight_in(frames[index], view, frames[0])
        assert isinstance(here, Highlight)
        assert isinstance(whole, Highlight)
        # An angle of the ball's surface that is a fifth of a pixel.
        near = np.degrees(0.2 / view.outline.radius)
        assert degrees_between(here.normal, true_normal(scene, lamp)) < near + 0.5
        assert np.hypot(here.x - whole.x, here.y - whole.y) < 0.3
        assert here.area_px == pytest.approx(whole.area_px, rel=0.25)


@pytest.mark.parametrize(("pushed_cm", "seen"), [(-3.7, True), (-6.5, False), (3.5, False)])
def test_a_ball_that_was_pushed(pushed_cm: float, seen: bool) -> None:
    """By three quarters of its radius; farther; and out of the picture."""
    scene = SMALL if pushed_cm < 0 else replace(SMALL, center=np.array([24.5, 7.0, -60.0]))
    pushed = replace(scene, center=scene.center + [pushed_cm, 0, 0])
    view, shift = view_of(scene), pushed.outline()[0] - scene.outline()[0]
    film = kept(
        view, [scene.photograph(), scene.photograph(LAMPS[0]), pushed.photograph(), pushed.photograph(LAMPS[0])]
    )
    moved = view.with_outline(view.outline.moved(shift, 0.0))
    found = film.highlights([1, 3], lambda index: moved if index >= 2 else view)
    assert isinstance(found[1], Highlight)
    if seen:
        assert isinstance(found[3], Highlight)
        assert degrees_between(found[3].normal, true_normal(pushed, LAMPS[0])) < 1
    else:
        assert found[3] == NoHighlight("the ball is out of its place so far that not all of it is seen")


def test_a_hidden_ball_has_no_highlight() -> None:
    view = view_of(SMALL)
    film = kept(view, [SMALL.photograph(), SMALL.photograph(LAMPS[0])])
    assert film.highlights([1], lambda index: None)[1] == NoHighlight("something is before the ball")
