"""The light as it is shown: display exposure, lamps, easing."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.config.look import Lamp, Lighting, Look
from relit_camera.base.images.color import luminance
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.light_map import LightMap, irradiance
from relit_camera.live.scene.light_transition import LightTransition, display_light
from relit_camera.live.scene.scene import Scene

STUDIO = builtin_environment("studio")


def ball(light: LightMap) -> float:
    """What a white ball facing the camera reads."""
    return float(luminance(np.asarray(irradiance(light, (0.0, 0.0, 1.0)))))


def scene(environment: Environment | None = STUDIO, **lighting: object) -> Scene:
    return Scene(Look(lighting=Lighting.model_validate(lighting)), environment)


@pytest.mark.parametrize("name", BUILTIN_NAMES)
@pytest.mark.parametrize("gain", [1.0, 40.0])
def test_every_environment_shows_a_white_ball_at_eight_tenths(name: str, gain: float) -> None:
    environment = builtin_environment(name)
    brighter = replace(environment, light_map=environment.light_map * np.float32(gain))
    assert ball(display_light(brighter, Lighting())) == pytest.approx(0.8, abs=1e-3)
    np.testing.assert_allclose(
        display_light(brighter, Lighting()), display_light(environment, Lighting()), rtol=1e-4, atol=1e-6
    )


def test_exposure_and_face_gain_are_stops() -> None:
    plain = display_light(STUDIO, Lighting())
    np.testing.assert_allclose(display_light(STUDIO, Lighting(exposure_ev=1, face_gain_ev=2)), 8 * plain, rtol=1e-5)


def test_a_lamp_is_as_bright_in_a_dark_room_as_in_a_bright_one() -> None:
    lamp = Lamp(azimuth_deg=0, elevation_deg=0, size_deg=30, intensity=0.5)
    alone = display_light(None, Lighting(environment=None, lamps=(lamp,)))
    assert ball(alone) == pytest.approx(0.5, rel=0.03)
    for name in ("studio", "night-street"):
        environment = builtin_environment(name)
        added = display_light(environment, Lighting(lamps=(lamp,))) - display_light(environment, Lighting())
        np.testing.assert_allclose(added, alone, atol=1e-4)


def test_no_light_at_all_is_dark() -> None:
    assert not display_light(None, Lighting(environment=None)).any()


def test_the_first_light_is_there_at_once() -> None:
    eased = LightTransition()
    np.testing.assert_array_equal(eased.update(scene(transition_s=5), 100.0), display_light(STUDIO, Lighting()))


def test_without_transition_a_change_is_whole_in_the_first_frame() -> None:
    eased = LightTransition()
    eased.update(scene(transition_s=0), 0.0)
    changed = eased.update(scene(transition_s=0, exposure_ev=-1), 0.04)
    np.testing.assert_array_equal(changed, display_light(STUDIO, Lighting(exposure_ev=-1)))


def test_a_change_is_seen_in_the_first_frame_and_ends_on_time() -> None:
    eased = LightTransition()
    levels = [ball(eased.update(scene(), 0.0))]
    darker = scene(exposure_ev=-2, transition_s=0.4)
    times = np.arange(1, 14) * 0.04
    levels += [ball(eased.update(darker, float(t))) for t in times]
    target = ball(display_light(STUDIO, Lighting(exposure_ev=-2)))
    assert levels[1] < 0.85 * levels[0]
    assert (np.diff(levels) <= 1e-6).all()
    assert levels[9] > target * 1.001
    assert levels[10] == pytest.approx(target, rel=1e-6)


def test_a_second_change_starts_from_what_is_shown() -> None:
    eased = LightTransition()
    eased.update(scene(), 0.0)
    eased.update(scene(exposure_ev=-4, transition_s=1.0), 0.1)
    halfway = ball(eased.update(scene(exposure_ev=-4, transition_s=1.0), 0.3))
    after = ball(eased.update(scene(transition_s=1.0), 0.301))
    assert after == pytest.approx(halfway, rel=0.05)


def test_a_clock_set_back_does_not_dazzle() -> None:
    """A file that begins anew: times go back in the middle of a change."""
    eased = LightTransition()
    eased.update(scene(), 50.0)
    before = ball(eased.update(scene(exposure_ev=-2, transition_s=1.0), 50.1))
    again = ball(eased.update(scene(exposure_ev=-2, transition_s=1.0), 0.0))
    low, high = sorted((ball(display_light(STUDIO, Lighting())), ball(display_light(STUDIO, Lighting(exposure_ev=-2)))))
    assert low - 1e-6 <= again <= high + 1e-6
    assert before <= high


def test_the_panorama_of_the_last_light_is_not_kept() -> None:
    environment = replace(builtin_environment("studio"))
    held, transition = weakref.ref(environment), LightTransition()
    transition.update(Scene(Look(), environment), 0.0)
    del environment
    gc.collect()
    assert held() is None
