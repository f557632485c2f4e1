"""How far a subject is to be trusted in a light: what of it was measured, is a guess, is softened."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.config.look import Lamp
from relit_camera.light.directions import fibonacci_directions
from relit_camera.light.light_map import LightMap
from relit_camera.light.scene_light import lamp_light_map
from relit_camera.subject.light_trust import LightTrust, light_trust
from relit_camera.subject.rungs import Rung
from tests.app.subject_builders import captured

SPHERE = fibonacci_directions(240).astype(np.float32)
SCREEN = SPHERE[SPHERE[:, 2] > np.cos(np.radians(27))]
FILM = SPHERE[SPHERE[:, 2] > np.cos(np.radians(75))]


def lamp(azimuth_deg: float) -> LightMap:
    return lamp_light_map([Lamp(azimuth_deg=azimuth_deg, elevation_deg=0, size_deg=5)])


def trusts(rung: Rung, lights: np.ndarray, light: LightMap) -> LightTrust:
    return light_trust(captured(rung, lights), light)


def test_a_lamp_before_a_screen_s_face_was_measured_one_behind_it_is_a_guess() -> None:
    assert trusts("desk", SCREEN, lamp(5)) == LightTrust(measured=1, behind=0, softened=0)
    assert trusts("desk", SCREEN, lamp(60)) == LightTrust(measured=0, behind=0, softened=0)
    assert trusts("desk", SCREEN, lamp(150)) == LightTrust(measured=0, behind=1, softened=0)


def test_a_film_measures_the_sides_too() -> None:
    assert trusts("film", FILM, lamp(60)).measured == 1
    assert trusts("film", FILM, lamp(150)) == LightTrust(measured=0, behind=1, softened=0)
    assert trusts("pictures", SPHERE, lamp(150)) == LightTrust(measured=1, behind=0, softened=0)


def test_of_an_instant_subject_nothing_is_measured_and_light_from_behind_is_softened() -> None:
    room = SPHERE[:1]
    assert trusts("instant", room, lamp(30)) == LightTrust(measured=0, behind=0, softened=0)
    assert trusts("instant", room, lamp(-120)) == LightTrust(measured=0, behind=1, softened=1)


def test_shares_are_of_energy() -> None:
    """A white lamp and one of a third of its light behind; a dark lamp behind counts for nothing."""
    both = lamp(5) + lamp(180) * np.float32(1 / 3)
    assert trusts("desk", SCREEN, both).behind == pytest.approx(0.25, abs=0.01)
    assert trusts("desk", SCREEN, both).measured == pytest.approx(0.75, abs=0.01)
    assert trusts("instant", SPHERE[:1], lamp(5) + 0 * lamp(180)).softened == 0
