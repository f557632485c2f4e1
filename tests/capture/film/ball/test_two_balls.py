"""Two balls triangulate the light."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.film.ball.light_direction import BallHighlight, triangulate_light
from relit_camera.capture.film.ball.specular_highlight import Highlight, find_highlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView
from tests.capture.film.ball.mirror_scene import MirrorScene

SCENES = [
    MirrorScene(size=(480, 360), focal_px=460.0, center=np.array([side * 20.0, 6.0, -62.0]), radius_cm=5.0)
    for side in (-1, 1)
]


def seen(scene: MirrorScene, lamp: np.ndarray) -> BallHighlight:
    view = PinholeView(BallOutline(*scene.outline()), scene.size, scene.focal_px)
    place = find_highlight(scene.photograph(lamp), view)
    assert isinstance(place, Highlight)
    return BallHighlight(view, scene.radius_cm, place.normal)


def test_the_place_of_a_lamp() -> None:
    for lamp in (np.array([-30.0, 40.0, 20.0]), np.array([10.0, 20.0, 35.0])):
        found = triangulate_light(*(seen(scene, lamp) for scene in SCENES))
        assert found is not None
        assert np.linalg.norm(found.position_cm - lamp) < 5  # of about a metre, from 40 cm apart
        assert found.gap_deg < 1


def test_rays_that_part_meet_nowhere() -> None:
    outer = [seen(scene, np.array([side * 120.0, 0.0, -20.0])) for side, scene in zip((-1, 1), SCENES, strict=True)]
    assert triangulate_light(*outer) is None
    assert triangulate_light(outer[0], outer[0]) is None
