"""The tour: what is shown when, and that whoever touches the panel has the camera."""

from __future__ import annotations

import threading
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.demo.tour import TOUR_STOPS, DemoRunner, tour_at
from relit_camera.base.config.look import Lighting, Look, Mode
from relit_camera.base.config.settings import StorageSettings
from relit_camera.live.scene.scene_controller import SceneController
from tests.small_camera import WAIT_S, wait_until

TOUR_S = sum(stop.seconds for stop in TOUR_STOPS)


@pytest.fixture
def scene_controller(tmp_path: Path) -> SceneController:
    made = SceneController(StorageSettings(data_dir=tmp_path))
    made.set_unlit_allowed(True)  # as the demonstration does: the clip as filmed is part of the tour
    made.set_look(tour_at(0.0)[1])
    return made


def test_it_begins_as_filmed_and_relights_in_many_places() -> None:
    assert tour_at(0.0)[1].lighting.split == 1
    places = {look.lighting.environment for _, look in map(tour_at, np.arange(0, TOUR_S, 0.25))}
    assert len(places - {None}) == 6
    assert None in places  # lamps alone


@pytest.mark.slow
def test_every_look_can_be_shown(scene_controller: SceneController) -> None:
    for time_s in np.arange(0, TOUR_S, 0.25):
        _, look = tour_at(float(time_s))
        assert scene_controller.set_look(look).look.mode is Mode.LIVE


def test_the_tour_begins_again() -> None:
    for time_s in (0.3, 5.0, 33.0):
        assert tour_at(time_s) == tour_at(time_s + TOUR_S)


def test_nothing_jumps_within_a_stop() -> None:
    times = np.arange(0, TOUR_S, 0.01)
    for before, after in pairwise(times):
        (stop, old), (following, new) = tour_at(before), tour_at(after)
        if stop is not following:
            continue
        assert abs(new.lighting.split - old.lighting.split) < 0.02
        assert abs(new.lighting.yaw_deg - old.lighting.yaw_deg) < 3
        for lamp, moved in zip(old.lighting.lamps, new.lighting.lamps, strict=True):
            assert abs(moved.azimuth_deg - lamp.azimuth_deg) < 2


def test_half_and_half_is_held_long_enough_to_be_seen() -> None:
    splits = np.array([tour_at(time_s)[1].lighting.split for time_s in np.arange(0, TOUR_S, 0.05)])
    assert (splits == 0.5).sum() * 0.05 > 0.8


def test_the_guide_tells_what_is_shown(scene_controller: SceneController) -> None:
    told: list[str] = []
    guide = DemoRunner(scene_controller, lambda: True, told.append)
    guide.start()
    wait_until(lambda: len(told) == 1)
    guide.stop()
    assert told == [TOUR_STOPS[0].caption, ""]


def test_the_guide_moves_the_look_along(scene_controller: SceneController, monkeypatch: pytest.MonkeyPatch) -> None:
    began = time.monotonic()
    # Ten times as fast.
    monkeypatch.setattr("relit_camera.app.demo.tour.time.monotonic", lambda: began + 10 * (time.perf_counter() - start))
    start = time.perf_counter()
    guide = DemoRunner(scene_controller, lambda: True, lambda caption: None)
    guide.start()
    deadline = time.perf_counter() + WAIT_S
    while scene_controller.scene.look.lighting.split == 1 and time.perf_counter() < deadline:
        time.sleep(0.02)
    guide.stop()
    assert scene_controller.scene.look.lighting.split < 1


def test_whoever_changes_the_look_has_the_camera(scene_controller: SceneController) -> None:
    ended = threading.Event()
    guide = DemoRunner(scene_controller, lambda: True, lambda caption: ended.set() if caption == "" else None)
    guide.start()
    mine = Look(lighting=Lighting(environment="party"))
    scene_controller.set_look(mine)
    assert ended.wait(WAIT_S)
    assert scene_controller.scene.look == mine
    guide.stop()


@pytest.mark.parametrize("mine", [0.0, 0.4])
def test_before_and_after_goes_with_the_tour_but_not_ones_own(scene_controller: SceneController, mine: float) -> None:
    ended = threading.Event()
    guide = DemoRunner(scene_controller, lambda: True, lambda caption: ended.set() if caption == "" else None)
    guide.start()
    assert scene_controller.scene.look.lighting.split == 1
    changes = {"environment": "party"} | ({"split": mine} if mine else {})
    scene_controller.update_look(
        lambda look: look.model_copy(update={"lighting": look.lighting.model_copy(update=changes)})
    )
    assert ended.wait(WAIT_S)
    guide.stop()
    assert scene_controller.scene.look.lighting.environment == "party"
    assert scene_controller.scene.look.lighting.split == mine


def test_whoever_freezes_the_picture_has_the_camera(
    scene_controller: SceneController, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic()
    monkeypatch.setattr("relit_camera.app.demo.tour.time.monotonic", lambda: now)  # the first stop, where nothing moves
    ended = threading.Event()
    guide = DemoRunner(scene_controller, lambda: True, lambda caption: ended.set() if caption == "" else None)
    guide.start()
    scene_controller.set_frozen(True)
    assert ended.wait(WAIT_S)
    guide.stop()


def test_where_nothing_moves_nothing_is_changed(scene_controller: SceneController) -> None:
    before = scene_controller.scene
    guide = DemoRunner(scene_controller, lambda: True, lambda caption: None)
    guide.start()
    time.sleep(0.5)
    guide.stop()
    assert scene_controller.scene is before


@pytest.mark.slow
def test_a_caption_is_told_again_for_who_comes_late(scene_controller: SceneController) -> None:
    told: list[str] = []
    guide = DemoRunner(scene_controller, lambda: True, told.append)
    guide.start()
    wait_until(lambda: len(told) == 2)
    guide.stop()
    assert told == [TOUR_STOPS[0].caption] * 2 + [""]


def test_the_tour_waits_until_there_is_something_to_see(scene_controller: SceneController) -> None:
    told: list[str] = []
    ready = threading.Event()
    guide = DemoRunner(scene_controller, ready.is_set, told.append)
    guide.start()
    time.sleep(0.2)
    assert told == []
    ready.set()
    wait_until(lambda: told == [TOUR_STOPS[0].caption])
    guide.stop()


def test_a_guide_that_never_began_ends(scene_controller: SceneController) -> None:
    told: list[str] = []
    guide = DemoRunner(scene_controller, lambda: False, told.append)
    guide.start()
    guide.stop()
    assert told == []


def test_stopping_is_harmless_before_the_beginning_and_twice(scene_controller: SceneController) -> None:
    guide = DemoRunner(scene_controller, lambda: True, lambda caption: None)
    guide.stop()
    guide.start()
    guide.stop()
    guide.stop()
