"""Highlights from what is kept of a film about the ball, against the ball's geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.ball_tracking import BallEpisode
from relit_camera.capture.film.ball.frame_highlights import BallCrops
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight, find_highlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView
from tests.capture.film.ball.mirror_scene import MirrorScene, degrees_between, hand_path, unit

LAMPS = hand_path(2, 100.0, np.array([0.0, -2.0, -58.0]))
SMALL = MirrorScene()
LARGE = MirrorScene((420, 400), 900.0, np.array([0.5, 0.4, -60.0]), 5.5, lamp_radius_cm=2.0, noise=0.002)


def true_normal(scene: MirrorScene, lamp: np.ndarray) -> np.ndarray:
    """By search over the surface: where the ways to camera and lamp make equal angles with the normal."""
    normal = unit(unit(lamp - scene.center) - unit(scene.center))
    for _ in range(50):
        point = scene.center + scene.radius_cm * normal
        normal = unit(unit(lamp - point) - unit(point))
    return normal


def view_of(scene: MirrorScene) -> PinholeView:
    return PinholeView(BallOutline(*scene.outline()), scene.size, scene.focal_px)


def kept(view: PinholeView, frames: list[LinearImage]) -> BallCrops:
    film = BallCrops(view.outline, view.size)
    for index, frame in enumerate(frames):
        film.add(index, frame)
    return film


@pytest.mark.parametrize("scene", [SMALL, LARGE], ids=["small", "large"])
def test_what_is_kept_tells_as_much_as_the_frame(scene: MirrorScene) -> None:
    frames = [scene.photograph(lamp, seed=n) for n, lamp in enumerate([None, *LAMPS])]
    view = view_of(scene)
    found = kept(view, frames).highlights(range(1, 1 + len(LAMPS)), view)
    for index, lamp in enumerate(LAMPS, 1):
        here, whole = found[index], find_highlight(frames[index], view, frames[0])
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
    found = film.highlights([1, 3], view, [BallEpisode("moved", 2, 3, shift, 0.0)])
    assert isinstance(found[1], Highlight)
    if seen:
        assert isinstance(found[3], Highlight)
        assert degrees_between(found[3].normal, true_normal(pushed, LAMPS[0])) < 1
    else:
        assert found[3] == NoHighlight("the ball is out of its place so far that not all of it is seen")
