"""Highlights in traced photographs, whose true positions follow from the lamp's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, DistantView
from tests.capture.film.ball.mirror_scene import MirrorScene, hand_path, highlight_in, true_normal, view_of

SCENE = MirrorScene(noise=0.002)
VIEW = view_of(SCENE)
LAMPS = hand_path(6, 100.0, np.array([0.0, -2.0, -58.0]))


def true_highlight(lamp: np.ndarray) -> tuple[float, float]:
    return SCENE.project(SCENE.center + SCENE.radius_cm * true_normal(SCENE, lamp))


@pytest.mark.parametrize("lamp", LAMPS)
def test_its_position_to_a_fraction_of_a_pixel(lamp: np.ndarray) -> None:
    found = highlight_in(SCENE.photograph(lamp, seed=1), VIEW, SCENE.photograph(seed=2))
    assert isinstance(found, Highlight)
    assert np.hypot(*np.subtract((found.x, found.y), true_highlight(lamp))) < 0.25
    assert found.brightness > 0.8


def test_a_mirrored_window_is_taken_off_though_the_exposure_changes() -> None:
    scene = MirrorScene(wall=0.2)
    lamp = LAMPS[2]
    bright, dark = scene.photograph(lamp, exposure=0.8, brightness=2.5), scene.photograph(exposure=1.2)
    bright[..., :] = np.where(bright > 0.9, 0.9, bright)
    found = highlight_in(bright, VIEW, dark)
    assert isinstance(found, Highlight)
    assert np.hypot(*np.subtract((found.x, found.y), true_highlight(lamp))) < 0.3


def test_the_smaller_of_two_does_not_count_however_bright() -> None:
    picture = SCENE.photograph(LAMPS[1])
    x, y = true_highlight(LAMPS[1])
    cv2.circle(picture, (int(SCENE.outline()[0] + 12), int(SCENE.outline()[1])), 1, (1.0, 1.0, 1.0), -1)
    found = highlight_in(picture, VIEW)
    assert isinstance(found, Highlight)
    assert np.hypot(found.x - x, found.y - y) < 0.3
    alone = SCENE.photograph()
    alone[int(y), int(x)] = 1
    assert isinstance(highlight_in(alone, VIEW, SCENE.photograph(), typical_area_px=40.0), NoHighlight)


def test_rays_of_a_glint_do_not_draw_it_away() -> None:
    view = DistantView(BallOutline(150, 120, 80))
    picture = np.zeros((240, 300, 3), np.float32)
    cv2.circle(picture, (160, 110), 8, (1.0, 1.0, 1.0), -1, cv2.LINE_AA)
    cv2.line(picture, (160, 110), (175, 175), (1.0, 1.0, 1.0), 3, cv2.LINE_AA)
    found = highlight_in(picture, view)
    assert isinstance(found, Highlight)
    assert np.hypot(found.x - 160.5, found.y - 110.5) < 1.0


def test_a_highlight_on_a_mirrored_white_window_is_not_measured() -> None:
    dark = np.full((240, 300, 3), 0.05, np.float32)
    dark[80:115, 120:160] = 1.0
    bright = dark.copy()
    cv2.circle(bright, (160, 100), 6, (1.0, 1.0, 1.0), -1)  # half of it on the window
    found = highlight_in(bright, DistantView(BallOutline(150, 120, 60)), dark)
    assert isinstance(found, NoHighlight)
    assert "another lamp, or of a bright window" in found.reason


def test_hidden() -> None:
    found = highlight_in(SCENE.photograph(seed=3), VIEW, SCENE.photograph(seed=4))
    assert isinstance(found, NoHighlight)
    assert "brighter" in found.reason


def test_a_ball_that_is_lit_itself_has_no_highlight() -> None:
    dark = np.full((240, 300, 3), 0.05, np.float32)
    lit = np.full((240, 300, 3), 0.5, np.float32)
    cv2.circle(lit, (150, 100), 4, (1.0, 1.0, 1.0), -1)
    found = highlight_in(lit, DistantView(BallOutline(150, 120, 60)), dark)
    assert isinstance(found, NoHighlight)


def test_over_exposed() -> None:
    picture = np.full((240, 320, 3), 0.05, np.float32)
    cv2.circle(picture, (220, 85), 20, (1.0, 1.0, 1.0), -1)
    found = highlight_in(picture, VIEW)
    assert isinstance(found, NoHighlight)
    assert "as bright as the highlight" in found.reason


def test_a_ball_outside_of_the_picture_is_refused() -> None:
    picture = SCENE.photograph()
    with pytest.raises(CaptureError, match="not in a picture of 320x240"):
        highlight_in(picture, DistantView(BallOutline(900, 900, 20)))
