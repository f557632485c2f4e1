"""What falls on the face: signs of the environment's angles, lamps, saturation."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.config.look import Lamp, Lighting
from relit_camera.base.images.color import luminance
from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles
from relit_camera.light.environments.environment_panorama import Environment, Panorama, environment_from_panorama
from relit_camera.light.light_map import LightMap, total
from relit_camera.light.scene_light import lamp_light_map, scene_light_map


def lit_from(azimuth: float, elevation: float) -> Environment:
    return environment_from_panorama(
        "lamp", Panorama(lamp_light_map([Lamp(azimuth_deg=azimuth, elevation_deg=elevation, color=(3, 2, 1))]))
    )


def brightest(light_map: LightMap) -> np.ndarray:
    energy = light_map[..., 0] * texel_solid_angles()
    vector = np.einsum("ij,ijk->k", energy, texel_directions())
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize(
    ("angles", "source", "expected"),
    # The same signs as the head's: what is in front goes right with yaw, down with pitch; the right goes up with roll.
    [
        ({"yaw_deg": 30}, (0, 0), (30, 0)),
        ({"pitch_deg": 30}, (0, 0), (0, -30)),
        ({"roll_deg": 30}, (90, 0), (90, 30)),
        ({"yaw_deg": 180}, (0, 20), (180, 20)),
        ({"yaw_deg": -360}, (40, 20), (40, 20)),
    ],
)
def test_the_environment_turns_as_the_head_does(
    angles: dict[str, float], source: tuple[float, float], expected: tuple[float, float]
) -> None:
    light_map = scene_light_map(lit_from(*source), Lighting(**angles))
    assert brightest(light_map) @ direction_from_degrees(*expected) > np.cos(np.radians(0.7))


def test_lamps_do_not_turn_with_the_environment() -> None:
    lamps = (Lamp(azimuth_deg=-50, elevation_deg=10),)
    light_map = scene_light_map(None, Lighting(yaw_deg=90, lamps=lamps))
    np.testing.assert_array_equal(light_map, lamp_light_map(lamps))


def test_environment_and_lamps_add_up() -> None:
    environment, lamps = lit_from(20, 0), (Lamp(azimuth_deg=-50, elevation_deg=10),)
    np.testing.assert_allclose(
        scene_light_map(environment, Lighting(lamps=lamps)), environment.light_map + lamp_light_map(lamps), rtol=1e-6
    )


def test_no_environment_and_no_lamp_is_darkness() -> None:
    assert not scene_light_map(None, Lighting()).any()


def test_saturation_0_is_grey_light_of_the_same_luminance() -> None:
    environment = lit_from(20, 0)
    lamps = (Lamp(kelvin=2500),)
    grey = scene_light_map(environment, Lighting(saturation=0, lamps=lamps))
    np.testing.assert_allclose(grey[..., 0], grey[..., 2], rtol=1e-6)
    np.testing.assert_allclose(
        luminance(grey), luminance(scene_light_map(environment, Lighting(lamps=lamps))), rtol=1e-5
    )


def test_more_saturation_widens_the_colours_and_never_goes_below_black() -> None:
    environment = lit_from(20, 0)
    plain, vivid = (total(scene_light_map(environment, Lighting(saturation=s))) for s in (1, 1.5))
    assert vivid[0] / vivid[2] > plain[0] / plain[2]
    assert (scene_light_map(environment, Lighting(saturation=4)) >= 0).all()


def test_exposure_is_not_applied() -> None:
    environment = lit_from(20, 0)
    np.testing.assert_array_equal(
        scene_light_map(environment, Lighting(exposure_ev=3)), scene_light_map(environment, Lighting(exposure_ev=0))
    )
