"""Photograph → highlight → direction, with lamps whose places are known."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, InputError
from relit_camera.capture.film.ball.light_direction import NearLight, distant_light_direction, radius_at_depth
from relit_camera.capture.film.ball.specular_highlight import Highlight, find_highlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, DistantView, PinholeView
from tests.capture.film.ball.mirror_scene import MirrorScene, degrees_between, hand_path, unit

SCENE = MirrorScene()
HEAD = np.array([0.0, -2.0, -58.0])


def view_of(scene: MirrorScene) -> PinholeView:
    return PinholeView(BallOutline(*scene.outline()), scene.size, scene.focal_px)


@pytest.mark.parametrize("lamp", hand_path(5, 100.0, HEAD))
def test_a_lamp_at_a_metre(lamp: np.ndarray) -> None:
    view = view_of(SCENE)
    place = find_highlight(SCENE.photograph(lamp), view, SCENE.photograph())
    assert isinstance(place, Highlight)
    near = NearLight(view, SCENE.radius_cm, HEAD, 100.0)
    found = near.direction(place.normal)
    assert degrees_between(found.at_ball, unit(lamp - SCENE.center)) < 1.5
    assert degrees_between(found.at_head, unit(lamp - HEAD)) < 1.5
    np.testing.assert_allclose(near.position_cm(place.normal), lamp, atol=3.0)
    # What the distances are for: the ball sees the lamp elsewhere than the head does.
    assert degrees_between(found.at_ball, unit(lamp - HEAD)) > 2


def test_a_lamp_far_away() -> None:
    way = unit(np.array([0.5, 0.4, 0.77]))
    scene = MirrorScene(lamp_radius_cm=1600.0)
    view = view_of(scene)
    place = find_highlight(scene.photograph(40000.0 * way), view)
    assert isinstance(place, Highlight)
    assert degrees_between(distant_light_direction(view, place.normal).at_head, way) < 0.8


def test_the_thesis_recipe_is_right_only_from_afar() -> None:
    lamp = hand_path(5, 100.0, HEAD)[3]
    place = find_highlight(SCENE.photograph(lamp), view_of(SCENE))
    assert isinstance(place, Highlight)
    afar = DistantView(BallOutline(*SCENE.outline()))
    plain = distant_light_direction(afar, afar.normals(np.array(place.x), np.array(place.y)))
    assert degrees_between(plain.at_ball, unit(lamp - SCENE.center)) > 8  # the ball is 13° off the axis
    long_lens = MirrorScene(focal_px=9000.0, center=np.array([3.0, 2.0, -1800.0]), lamp_radius_cm=1600.0)
    way = unit(np.array([-0.4, 0.3, 0.86]))
    far = find_highlight(long_lens.photograph(40000.0 * way), view_of(long_lens))
    assert isinstance(far, Highlight)
    afar = DistantView(BallOutline(*long_lens.outline()))
    plain = distant_light_direction(afar, afar.normals(np.array(far.x), np.array(far.y)))
    assert degrees_between(plain.at_ball, way) < 1.5


def test_the_ball_s_size_follows_from_its_depth() -> None:
    assert radius_at_depth(view_of(SCENE), 60.0) == pytest.approx(SCENE.radius_cm, rel=3e-3)
    with pytest.raises(CaptureError, match="-3"):
        radius_at_depth(view_of(SCENE), -3.0)


def test_a_light_said_to_be_nearer_than_the_ball_is_refused() -> None:
    with pytest.raises(InputError, match="15 cm from the head"):
        NearLight(view_of(SCENE), SCENE.radius_cm, HEAD, 15.0)
