"""Two balls triangulate the light."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.ball.highlight import Highlight, find_highlight
from relit_camera.capture.ball.outline import Outline
from relit_camera.capture.ball.two_balls import BallHighlight, locate_light
from relit_camera.capture.ball.view import PinholeView
from tests.capture.ball.mirror_scene import MirrorScene

SCENES = [
    MirrorScene(size=(480, 360), focal_px=460.0, centre=np.array([side * 20.0, 6.0, -62.0]), radius_cm=5.0)
    for side in (-1, 1)
]


def seen(scene: MirrorScene, lamp: np.ndarray) -> BallHighlight:
    view = PinholeView(Outline(*scene.outline()), scene.size, scene.focal_px)
    place = find_highlight(scene.photograph(lamp), view)
    assert isinstance(place, Highlight)
    return BallHighlight(view, scene.radius_cm, place.normal)


def test_the_place_of_a_lamp() -> None:
    for lamp in (np.array([-30.0, 40.0, 20.0]), np.array([10.0, 20.0, 35.0])):
        found = locate_light(*(seen(scene, lamp) for scene in SCENES))
        assert found is not None
        assert np.linalg.norm(found.position_cm - lamp) < 5  # of about a metre, from 40 cm apart
        assert found.gap_deg < 1


def test_rays_that_part_meet_nowhere() -> None:
    outer = [seen(scene, np.array([side * 120.0, 0.0, -20.0])) for side, scene in zip((-1, 1), SCENES, strict=True)]
    assert locate_light(*outer) is None
    assert locate_light(outer[0], outer[0]) is None
