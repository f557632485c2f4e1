"""The lamp's position from the rays of two balls."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.film.ball.specular_highlight import Highlight
from relit_camera.capture.film.lamp.light_from_highlight import BallHighlight, triangulate_lamp
from tests.capture.film.ball.mirror_scene import MirrorScene, highlight_in, view_of

SCENES = [
    MirrorScene(size=(480, 360), focal_px=460.0, center=np.array([side * 20.0, 6.0, -62.0]), radius_cm=5.0)
    for side in (-1, 1)
]


def seen(scene: MirrorScene, lamp: np.ndarray) -> BallHighlight:
    view = view_of(scene)
    place = highlight_in(scene.photograph(lamp), view)
    assert isinstance(place, Highlight)
    return BallHighlight(view, scene.radius_cm, place.normal)


def test_the_position_of_a_lamp() -> None:
    for lamp in (np.array([-30.0, 40.0, 20.0]), np.array([10.0, 20.0, 35.0])):
        found = triangulate_lamp(*(seen(scene, lamp) for scene in SCENES))
        assert found is not None
        assert np.linalg.norm(found.position_cm - lamp) < 5  # of about a metre, from 40 cm apart
        assert found.gap_deg < 1


def test_diverging_rays_have_no_position() -> None:
    outer = [seen(scene, np.array([side * 120.0, 0.0, -20.0])) for side, scene in zip((-1, 1), SCENES, strict=True)]
    assert triangulate_lamp(*outer) is None
    assert triangulate_lamp(outer[0], outer[0]) is None
