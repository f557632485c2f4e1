"""The picture as filmed is never published without a confirmed choice: tried in each way in which it could be."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest

from relit_camera.app import wiring
from relit_camera.app.camera_service import NO_SUBJECT_MESSAGE
from relit_camera.base.config.look import ANYONE, Lighting, Look, Mode
from relit_camera.base.config.settings import Fallback
from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.face_state import LOST, FaceState
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject
from tests.api.api_client import decoded_picture
from tests.app.test_camera_service import IMPATIENT
from tests.small_camera import (
    FPS,
    PATIENT,
    SIZE,
    WAIT_S,
    Camera,
    SteadyTracker,
    difference,
    memory_source,
    running_camera,
    wait_until,
)

FILMED: DisplayImage = np.random.default_rng(3).integers(60, 200, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
LIVE = Look(mode=Mode.LIVE, lighting=Lighting(exposure_ev=-2, transition_s=0))
ONE_S = int(FPS)
SETTLED = 2 * ONE_S
"""New pictures, after which a face that came or went has been eased in or out."""


def share_as_filmed(picture: DisplayImage) -> float:
    """The share of a picture's pixels that are those of the frame, but for what rounding does."""
    return float((np.abs(picture.astype(int) - FILMED) <= 2).all(axis=2).mean())


def check_nothing_as_filmed(camera: Camera) -> None:
    """Every picture so far, and of the next half second."""
    camera.sink.wait_for(1)
    count = camera.sink.count
    wait_until(lambda: camera.sink.count >= count + ONE_S // 2)
    assert max(map(share_as_filmed, list(camera.sink.new))) < 0.02
    assert not camera.status()["unlit"]


class Tracker(SteadyTracker):
    """Sees the steady face where `sees` says so of a frame's index, `tilted` by so many degrees."""

    def __init__(self, sees: Callable[[int], bool] = lambda index: True, tilted_deg: float = 0.0) -> None:
        super().__init__()
        self._sees, self._tilted = sees, tilted_deg

    def track(self, frame: Frame) -> FaceState:
        state = super().track(frame)
        if not self._sees(frame.index):
            return LOST
        if self._tilted:
            assert state.pose is not None
            turn = rotation_from_angles(0, self._tilted)
            return replace(state, pose=replace(state.pose, rotation=turn * state.pose.rotation))
        return state


def test_the_pattern_is_told_from_others() -> None:
    assert share_as_filmed(FILMED) == 1
    assert share_as_filmed(255 - FILMED) < 0.02


@pytest.mark.parametrize("mode", list(Mode))
def test_no_subject(tmp_path: Path, mode: Mode) -> None:
    with running_camera(tmp_path, memory_source(FILMED), look=LIVE.model_copy(update={"mode": mode})) as camera:
        wait_until(lambda: camera.status()["state"] == "live")
        camera.put("subject", name=None)
        wait_until(lambda: camera.status()["state"] == "no-subject")
        count = camera.sink.count
        wait_until(lambda: camera.sink.count >= count + 2)
        assert difference(camera.sink.new[-1], placeholder(SIZE, NO_SUBJECT_MESSAGE)) == 0  # and not the last picture
        check_nothing_as_filmed(camera)
        assert DegradationCode.NO_SUBJECT in camera.degraded()


@pytest.mark.slow
@pytest.mark.parametrize("sees", [True, False], ids=["seen at once", "never there"])
def test_whoever_comes_is_relit_from_the_first_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sees: bool
) -> None:
    """Before what relights them is made the placeholder alone is published, however long that takes."""
    made, make = threading.Event(), wiring._make_anyone

    def make_late() -> Subject:
        assert made.wait(WAIT_S)
        return make()

    monkeypatch.setattr(wiring, "_make_anyone", make_late)
    source, tracker = memory_source(FILMED), Tracker(lambda index: sees)
    with running_camera(tmp_path, source, tracker, subject=ANYONE, look=LIVE, timings=PATIENT) as camera:
        wait_until(lambda: camera.sink.count >= ONE_S)
        (shown,) = camera.sink.new
        assert difference(shown, placeholder(SIZE, "starting")) == 0
        made.set()
        camera.sink.wait_for(SETTLED)
        check_nothing_as_filmed(camera)


class TrackerWithoutModels(SteadyTracker):
    def track(self, frame: Frame) -> FaceState:
        raise ModelError("models are missing", "run: relit models pull")


def test_without_models_whoever_comes_is_a_placeholder(tmp_path: Path) -> None:
    tracker = TrackerWithoutModels()
    with running_camera(tmp_path, memory_source(FILMED), tracker, subject=ANYONE, look=LIVE) as camera:
        wait_until(lambda: camera.status()["state"] == "standing-in")
        wait_until(lambda: camera.sink.count >= ONE_S)
        placeholders = [placeholder(SIZE, why) for why in ("starting", "the picture has failed: see the panel")]
        assert all(min(difference(shown, each) for each in placeholders) == 0 for shown in camera.sink.new)
        assert not camera.status()["unlit"]


def test_it_is_published_once_that_is_confirmed_and_no_longer_when_it_is_withdrawn(tmp_path: Path) -> None:
    with running_camera(tmp_path, memory_source(FILMED), look=LIVE) as camera:
        camera.http.patch("scene", json={"subject": None, "unlit_allowed": True}).raise_for_status()
        wait_until(lambda: bool(camera.status()["unlit"]))
        wait_until(lambda: share_as_filmed(camera.sink.new[-1]) == 1)
        camera.put("freeze", frozen=True)
        camera.http.patch("scene", json={"unlit_allowed": False}).raise_for_status()
        wait_until(lambda: not camera.status()["unlit"])
        wait_until(lambda: share_as_filmed(camera.sink.new[-1]) < 0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    "sees",
    [lambda index: False, lambda index: index < 25, lambda index: index % 20 < 10],
    ids=["never there", "lost", "coming and going"],
)
def test_a_face_that_is_lost(tmp_path: Path, sees: Callable[[int], bool]) -> None:
    with running_camera(tmp_path, memory_source(FILMED), Tracker(sees), look=LIVE) as camera:
        camera.sink.wait_for(SETTLED)
        check_nothing_as_filmed(camera)


@pytest.mark.slow
def test_a_head_that_is_bowed_at_the_start(tmp_path: Path) -> None:
    with running_camera(tmp_path, memory_source(FILMED), Tracker(tilted_deg=30), look=LIVE) as camera:
        camera.sink.wait_for(SETTLED)
        check_nothing_as_filmed(camera)


@pytest.mark.slow
@pytest.mark.parametrize("change", [{"split": 0.5}, {"split": 1.0}, {"blend": 0.0}])
def test_as_filmed(tmp_path: Path, change: dict[str, float]) -> None:
    with running_camera(tmp_path, memory_source(FILMED), look=LIVE) as camera:
        assert camera.http.patch("lighting", json=change).status_code == 409
        camera.sink.wait_for(SETTLED)
        check_nothing_as_filmed(camera)
        camera.http.patch("scene", json={"lighting": change, "unlit_allowed": True}).raise_for_status()
        wait_until(lambda: bool(camera.status()["unlit"]))
        wait_until(lambda: share_as_filmed(camera.sink.new[-1]) > 0.4)


class BrokenTracker(SteadyTracker):
    """Fails from the start."""

    def track(self, frame: Frame) -> FaceState:
        raise ZeroDivisionError("a bug")


@pytest.mark.parametrize("allowed", [False, True])
def test_the_fallback(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, allowed: bool) -> None:
    """Neither tracking nor relighting works, and the settings want the live picture then."""

    def fail(*_: object) -> None:
        raise ZeroDivisionError("another bug")

    monkeypatch.setattr(BasisRelighter, "relight", fail)
    with running_camera(
        tmp_path,
        memory_source(FILMED),
        BrokenTracker(),
        look=LIVE,
        fallback=Fallback.FILMED,
        timings=IMPATIENT,
        unlit_allowed=allowed,
    ) as camera:
        wait_until(lambda: camera.status()["state"] == "standing-in")
        if allowed:
            wait_until(lambda: bool(camera.status()["unlit"]))
            wait_until(lambda: share_as_filmed(camera.sink.new[-1]) == 1)
        else:
            check_nothing_as_filmed(camera)


@pytest.mark.slow
def test_before_is_for_the_preview_alone_and_taken_from_nobody(tmp_path: Path) -> None:
    with running_camera(tmp_path, memory_source(FILMED), look=LIVE) as camera:
        camera.sink.wait_for(ONE_S // 4)
        with camera.http.stream("GET", "preview.mjpg", params={"before": "true"}) as body:
            picture = first_picture(body)
        assert likeness(picture) > 0.75
        check_nothing_as_filmed(camera)


def first_picture(body: httpx.Response) -> DisplayImage:
    data = b""
    for part in body.iter_bytes():
        data += part
        head = data.find(b"\r\n\r\n")
        if head >= 0:
            length = int(data[:head].split(b"Content-Length: ")[1])
            if len(data) >= head + 4 + length:
                return decoded_picture(data[head + 4 : head + 4 + length])
    raise AssertionError("the preview ended")


def likeness(picture: DisplayImage) -> float:
    """The correlation with the frame in grey: a JPEG file of coloured noise is not exact."""
    return float(np.corrcoef(picture.mean(axis=2).ravel(), FILMED.mean(axis=2).ravel())[0, 1])
