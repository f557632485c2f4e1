"""How far the scene's subject is to be trusted in the scene's light: environment as it is turned, and lamps."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from relit_camera.base.config.look import Lamp, Lighting, Look
from relit_camera.light.directions import fibonacci_directions
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.live.scene import present_light
from relit_camera.live.scene.present_light import PresentLight
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.light_trust import LightTrust
from tests.app.subject_builders import captured

SPHERE = fibonacci_directions(240).astype(np.float32)
FILMED = captured("film", SPHERE[SPHERE[:, 2] > np.cos(np.radians(75))])
SUNSET = builtin_environment("sunset")
BEHIND = Lamp(azimuth_deg=170, elevation_deg=0, size_deg=20, intensity=4)


def trust_in(environment: bool = True, **lighting: object) -> LightTrust:
    look = Look().model_copy(update={"lighting": Lighting().model_copy(update=lighting)})
    found = PresentLight().trust(Scene(look, SUNSET if environment else None, subject=FILMED))
    assert found is not None
    return found


def test_an_environment_counts_as_it_is_turned() -> None:
    """The sun of that sunset stands before the face; turned by half, it stands behind."""
    ahead, turned = trust_in(), trust_in(yaw_deg=180)
    assert ahead.measured > 0.5 > turned.measured
    assert turned.behind > 0.5 > ahead.behind


def test_lamps_count_with_the_environment_in_its_exposure() -> None:
    assert trust_in(lamps=(BEHIND,)).behind > trust_in().behind + 0.1
    assert trust_in(lamps=(BEHIND.model_copy(update={"muted": True}),)) == trust_in()
    assert trust_in(environment=False, lamps=(BEHIND,)).behind == pytest.approx(1, abs=0.01)


def test_without_a_subject_or_a_light_there_is_nothing_to_tell() -> None:
    present = PresentLight()
    assert present.trust(Scene(Look(), SUNSET, revision=1)) is None
    dark = Look().model_copy(update={"lighting": Lighting(environment=None)})
    assert present.trust(Scene(dark, None, subject=FILMED, revision=2)) is None


def test_it_is_computed_once_for_each_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = count(1)
    monkeypatch.setattr(present_light, "light_trust", lambda subject, light: next(numbers))
    present, scene = PresentLight(), Scene(Look(), SUNSET, subject=FILMED, revision=7)
    assert [present.trust(scene) for _ in range(3)] == [1, 1, 1]
    assert present.trust(replace(scene, revision=8)) == 2
