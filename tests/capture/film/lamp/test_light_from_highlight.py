"""The lamp's position from one ball and the distance from the head, for lamps whose positions are known."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, InputError
from relit_camera.capture.film.ball.specular_highlight import Highlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, DistantView
from relit_camera.capture.film.lamp.light_from_highlight import BallHighlight, position_at_distance, radius_at_depth
from tests.capture.film.ball.mirror_scene import MirrorScene, degrees_between, hand_path, highlight_in, unit, view_of

SCENE = MirrorScene()
HEAD = np.array([0.0, -2.0, -58.0])


@pytest.mark.parametrize("lamp", hand_path(5, 100.0, HEAD))
def test_a_lamp_at_a_metre(lamp: np.ndarray) -> None:
    view = view_of(SCENE)
    highlight = highlight_in(SCENE.photograph(lamp), view, SCENE.photograph())
    assert isinstance(highlight, Highlight)
    found = position_at_distance(BallHighlight(view, SCENE.radius_cm, highlight.normal), HEAD, 100.0)
    assert degrees_between(unit(found - SCENE.center), unit(lamp - SCENE.center)) < 1.5
    assert degrees_between(unit(found - HEAD), unit(lamp - HEAD)) < 1.5
    np.testing.assert_allclose(found, lamp, atol=3.0)
    # What the distance is for: the ball sees the lamp elsewhere than the head does.
    assert degrees_between(unit(found - SCENE.center), unit(lamp - HEAD)) > 2


def test_a_lamp_far_away_is_where_the_ray_points() -> None:
    direction = unit(np.array([0.5, 0.4, 0.77]))
    scene = MirrorScene(lamp_radius_cm=1600.0)
    view = view_of(scene)
    highlight = highlight_in(scene.photograph(40000.0 * direction), view)
    assert isinstance(highlight, Highlight)
    assert degrees_between(view.reflect(highlight.normal), direction) < 0.8


def test_the_thesis_recipe_is_right_only_from_afar() -> None:
    lamp = hand_path(5, 100.0, HEAD)[3]
    near = highlight_in(SCENE.photograph(lamp), view_of(SCENE))
    assert isinstance(near, Highlight)
    orthographic = DistantView(BallOutline(*SCENE.outline()))
    ray = orthographic.reflect(orthographic.normals(np.array(near.x), np.array(near.y)))
    assert degrees_between(ray, unit(lamp - SCENE.center)) > 8  # the ball is 13° off the axis
    long_lens = MirrorScene(focal_px=9000.0, center=np.array([3.0, 2.0, -1800.0]), lamp_radius_cm=1600.0)
    direction = unit(np.array([-0.4, 0.3, 0.86]))
    far = highlight_in(long_lens.photograph(40000.0 * direction), view_of(long_lens))
    assert isinstance(far, Highlight)
    orthographic = DistantView(BallOutline(*long_lens.outline()))
    ray = orthographic.reflect(orthographic.normals(np.array(far.x), np.array(far.y)))
    assert degrees_between(ray, direction) < 1.5


def test_the_ball_s_size_follows_from_its_depth() -> None:
    assert radius_at_depth(view_of(SCENE), 60.0) == pytest.approx(SCENE.radius_cm, rel=3e-3)
    with pytest.raises(CaptureError, match="-3"):
        radius_at_depth(view_of(SCENE), -3.0)


def test_a_light_said_to_be_nearer_than_the_ball_is_refused() -> None:
    highlight = BallHighlight(view_of(SCENE), SCENE.radius_cm, np.array([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="15 cm from the head"):
        position_at_distance(highlight, HEAD, 15.0)
