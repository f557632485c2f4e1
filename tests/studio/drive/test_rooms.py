"""The rooms of driving videos: where their light comes from, and how much."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.light.directions import direction_from_degrees
from relit_camera.light.light_map import irradiance
from relit_studio.drive.painted_rooms import ROOMS, paint_room
from relit_studio.drive.room import Room

FRONT, LEFT, RIGHT, UP = ((0, 0), (-90, 0), (90, 0), (0, 90))


def lit_from(name: str, azimuth_deg: float, elevation_deg: float) -> float:
    """How bright a white wall is that faces AZ, EL, relative to one that faces the webcam."""
    light_map = Room(paint_room(name)).light_map
    facing = np.stack([direction_from_degrees(azimuth_deg, elevation_deg), direction_from_degrees(*FRONT)])
    wall, front = irradiance(light_map, facing).mean(axis=1)
    return float(wall / front)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROOMS)
def test_a_room_is_light_all_round(name: str) -> None:
    light_map = Room(paint_room(name)).light_map
    assert light_map.shape == (32, 64, 3)
    assert np.isfinite(light_map).all()
    assert light_map.min() > 0


@pytest.mark.slow
def test_soft_light_comes_from_the_front() -> None:
    assert lit_from("soft", *LEFT) < 1.5
    assert lit_from("soft", *RIGHT) > 0.3


@pytest.mark.slow
def test_a_side_window_lights_the_pictures_left_and_little_else() -> None:
    assert lit_from("side-window", *LEFT) > 2
    assert lit_from("side-window", *RIGHT) < 0.3


@pytest.mark.slow
def test_ceiling_light_comes_from_above() -> None:
    assert lit_from("ceiling", *UP) > 2


@pytest.mark.slow
def test_a_screen_at_night_lights_what_faces_it() -> None:
    for place in (LEFT, RIGHT, UP):
        assert lit_from("screen", *place) < 0.5
