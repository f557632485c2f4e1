"""The subject in the scene's light, relit in some frames only."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from relit_camera.base.config.look import Look
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.scene_relighting import SceneRelighting, body_fraction
from relit_camera.live.scene.light_transition import LightTransition, display_light
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from tests.live.people import close_up, face_of

SUNSET = Scene(Look(), builtin_environment("sunset"))
PARTY = Scene(Look(), builtin_environment("party"))


class Counting(BasisRelighter):
    """Counts how often it relights, and under how many lights."""

    def __init__(self) -> None:
        super().__init__(close_up())
        self.lights: list[int] = []

    def relight(self, light_maps: np.ndarray) -> np.ndarray:
        self.lights.append(len(light_maps))
        return super().relight(light_maps)


def made() -> tuple[SceneRelighting, Counting]:
    relighter = Counting()
    return SceneRelighting(close_up(), face_of(close_up()), relighter, LightTransition(), StageTimer()), relighter


def turn(index: int) -> Rotation:
    return rotation_from_angles(10 * np.sin(index / 10), 3 * np.sin(index / 7), 0)


def truth(scene: Scene, index: int) -> np.ndarray:
    """The head in light that was turned against it, the body in the room's light as it is."""
    light = display_light(scene.environment, scene.look.lighting) * np.float32(close_up().metadata.display_gain)
    return head_and_body(light, index)


def head_and_body(light: LightMap, index: int) -> np.ndarray:
    head, body = BasisRelighter(close_up()).relight(np.stack([rotate_light_map(light, turn(index)), light]))
    fraction = body_fraction(face_of(close_up()))[..., None]
    return head * (1 - fraction) + body * fraction


@pytest.mark.slow
def test_a_turning_head_is_relit_in_every_second_frame_and_lit_rightly_in_all() -> None:
    ours, relighter = made()
    pictures = [ours.relight(SUNSET, turn(index), index / 30, 2) for index in range(30)]
    assert 14 <= len(relighter.lights) <= 17
    assert min(psnr(pictures[index], truth(SUNSET, index)) for index in range(3, 30)) > 45


def test_a_change_of_light_is_eased_in_every_frame() -> None:
    ours, relighter = made()
    for index in range(6):
        ours.relight(SUNSET, turn(0), index / 30, 2)
    assert relighter.lights == [2]  # of the head and of the body
    seen = [ours.relight(PARTY, turn(0), (6 + index) / 30, 2) for index in range(20)]
    assert 10 <= len(relighter.lights) <= 15  # in 0.4 s, then no more
    steps = [psnr(a, b) for a, b in pairwise(seen)]
    assert steps == sorted(steps)  # fast at first
    assert psnr(seen[-1], truth(PARTY, 0)) > 60


@pytest.mark.slow
def test_scene_and_room_are_relit_together_and_combined() -> None:
    ours, relighter = made()
    room: LightMap = builtin_environment("window").light_map
    head = partial(rotate_light_map, room)
    both = ours.compare(SUNSET, turn(3), 0.1, room, head, lambda scene, room: np.concatenate([scene, room]), 2)
    assert relighter.lights == [4]
    height = close_up().matte.shape[0]
    np.testing.assert_allclose(both[:height], truth(SUNSET, 3), rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(both[height:], head_and_body(room, 3), rtol=1e-3, atol=1e-5)
    again = replace(SUNSET, revision=1)
    assert ours.compare(again, turn(3), 0.2, room, head, lambda *_: np.zeros(0, np.float32), 2) is both


def test_the_body_is_relit_only_where_its_light_changes() -> None:
    ours, relighter = made()
    for index in range(12):
        ours.relight(SUNSET, turn(index), index / 30, 1)
    assert relighter.lights == [2] + 11 * [1]


def test_the_light_on_the_body_stays_while_the_head_turns() -> None:
    ours, _ = made()
    pictures = np.stack([ours.relight(SUNSET, turn(index), index / 30, 1) for index in range(12)])
    fraction = body_fraction(face_of(close_up()))
    change = np.ptp(pictures, axis=0).max(axis=-1)
    assert fraction.max() == 1
    assert change[fraction == 1].max() < 1e-6
    assert change[fraction == 0].mean() > 0.01


def test_a_picture_without_a_body_costs_one_light_a_frame() -> None:
    relighter, face = Counting(), face_of(close_up())
    near = replace(face, pose=replace(face.pose, translation=face.pose.translation * [1, 1, 0.5]))
    ours = SceneRelighting(close_up(), near, relighter, LightTransition(), StageTimer())
    ours.relight(SUNSET, turn(0), 0.0, 1)
    assert relighter.lights == [1]


def test_the_neck_turns_in_part() -> None:
    fraction = body_fraction(face_of(close_up()))
    column = fraction[:, fraction.shape[1] // 2]
    assert (np.diff(column) >= 0).all()
    assert column[0] == 0
    assert column[-1] == 1
    assert ((column > 0.2) & (column < 0.8)).any()
