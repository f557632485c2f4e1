"""The webcam goes, comes back elsewhere, stalls, or gives what is no picture of the right kind."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.camera_service import DEFAULT_TIMINGS, CameraTimings
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sources import webcam_source
from relit_camera.devices.sources.webcam_source import WebcamSource
from relit_camera.live.publishing.placeholder_image import placeholder
from tests.devices.fake_devices import FakeCapture, FakeTree
from tests.faults.watched_camera import MOST_STOP_S, STOP_S, Survived, Watched, watched_camera
from tests.small_camera import FPS, SIZE, difference, wait_until

STALL_S = float(os.environ.get("FAULT_STALL_S", "1"))
"""The table of docs/reliability.md is made with 30."""
SOON_STALE = CameraTimings(stale_after_s=1.0)
"""For tests that wait until the placeholder says that the webcam is waited for."""


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes seconds in life takes tenths here."""
    monkeypatch.setattr(webcam_source, "FIRST_FRAME_TIMEOUT_S", 0.5)
    monkeypatch.setattr(webcam_source, "BACKOFF_S", (0.1, 0.2))


@pytest.fixture
def tree(tmp_path: Path) -> FakeTree:
    made = FakeTree(tmp_path / "root")
    made.add_webcam(0, "HD Webcam", by_id="usb-Maker_HD_Webcam-video-index0")
    return made


class Cameras:
    """What the webcam's driver does; every opening makes a capture of the present kind."""

    def __init__(self) -> None:
        self.make: Callable[[], FakeCapture] = lambda: FakeCapture(interval_s=1 / 30)
        self.opened: list[FakeCapture] = []
        self.nodes: list[str] = []

    def __call__(self, node: str, size: tuple[int, int], fps: float) -> FakeCapture:
        self.nodes.append(node)
        self.opened.append(self.make())
        return self.opened[-1]


def watched_webcam(
    tmp_path: Path, tree: FakeTree, cameras: Cameras, timings: CameraTimings = DEFAULT_TIMINGS
) -> AbstractContextManager[Watched]:
    source = WebcamSource("webcam", SIZE, 30, tree=tree, open_capture=cameras, stall_timeout_s=0.5)
    return watched_camera(tmp_path / "data", source=source, timings=timings)


def waiting(watched: Watched) -> None:
    """Wait until the placeholder says so."""
    picture = placeholder(SIZE, "waiting for the camera")
    wait_until(lambda: difference(watched.sink.new[-1], picture) == 0)


def test_unplugged_and_back_under_another_number(tmp_path: Path, tree: FakeTree, survived: Survived) -> None:
    cameras = Cameras()
    with watched_webcam(tmp_path, tree, cameras, SOON_STALE) as watched:
        tree.remove(0)
        cameras.opened[-1].mode = "silent"
        watched.reports("unplugged")
        waiting(watched)
        tree.add_webcam(3, "HD Webcam", by_id="usb-Maker_HD_Webcam-video-index0")
        watched.recovers()
        assert cameras.nodes[-1].endswith("video3")
        survived("webcam unplugged, back under another number", watched)


@pytest.mark.parametrize("mode", ["silent", "stuck"])
def test_a_stall(mode: str, tmp_path: Path, tree: FakeTree, survived: Survived) -> None:
    cameras = Cameras()
    with watched_webcam(tmp_path, tree, cameras, SOON_STALE) as watched:
        stalled = cameras.opened[-1]
        stalled.mode = mode
        cameras.make = lambda: FakeCapture(mode="silent")  # opening it again does not help
        waiting(watched)
        watched.reports("gives no pictures")
        tried = len(cameras.opened)
        watched.goes_on(round(STALL_S * FPS))
        if mode == "silent":
            wait_until(lambda: len(cameras.opened) >= tried + 2)
        cameras.make = lambda: FakeCapture(interval_s=1 / 30)
        stalled.unstick.set()
        watched.recovers()
        what = "gives nothing" if mode == "silent" else "does not answer"
        survived(f"webcam {what} for {STALL_S:g} s", watched)


def test_it_stops_in_time_while_the_webcam_hangs(tmp_path: Path, tree: FakeTree) -> None:
    cameras = Cameras()
    with watched_webcam(tmp_path, tree, cameras, CameraTimings(stop_timeout_s=STOP_S)) as watched:
        hanging = cameras.opened[-1]
        hanging.mode = "stuck"
        wait_until(hanging.is_stuck.is_set)
        camera_service, began = watched.camera.camera_service, time.monotonic()
        camera_service.stop()
        assert watched.lateness.unexplained_s(began, time.monotonic()) < MOST_STOP_S
        # What else is late on a busy machine ends.
        wait_until(lambda: camera_service.hung_threads == ["source-webcam"])
        hanging.unstick.set()
        wait_until(lambda: camera_service.hung_threads == [])


class Odd(FakeCapture):
    """Gives pictures of a list, over and over."""

    def __init__(self, pictures: list[np.ndarray]) -> None:
        super().__init__(interval_s=1 / 30)
        self.pictures: Iterator[np.ndarray] = itertools.cycle(pictures)
        self.given = 0

    def read(self) -> tuple[bool, np.ndarray | None]:
        time.sleep(self.interval_s)
        self.given += 1
        return True, next(self.pictures)


def _noise(*shape: int) -> DisplayImage:
    return np.random.default_rng(1).integers(0, 256, shape, np.uint8)


def _torn() -> DisplayImage:
    picture = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    picture[SIZE[1] // 2 :] = _noise(SIZE[1] // 2, SIZE[0], 3)
    return picture


ODD: dict[str, list[np.ndarray]] = {
    "torn pictures": [_torn()],
    "black pictures": [np.zeros((SIZE[1], SIZE[0], 3), np.uint8)],
    "pictures of changing size": [_noise(48, 64, 3), _noise(720, 1280, 3), _noise(97, 33, 3)],
    "pictures of one pixel": [_noise(1, 1, 3)],
    "grey pictures": [_noise(SIZE[1], SIZE[0])],
    "pictures without pixels": [np.zeros((0, 0, 3), np.uint8)],
    "pictures with four channels": [_noise(SIZE[1], SIZE[0], 4)],
    "pictures of 16 bits": [_noise(SIZE[1], SIZE[0], 3).astype(np.uint16)],
}


@pytest.mark.parametrize("name", ODD)
def test_odd_pictures(name: str, tmp_path: Path, tree: FakeTree, survived: Survived) -> None:
    cameras = Cameras()
    with watched_webcam(tmp_path, tree, cameras) as watched:
        odd = Odd(ODD[name])
        cameras.make = lambda: odd
        cameras.opened[-1].mode = "silent"  # so that it is opened again
        wait_until(lambda: odd.given >= 15)
        watched.goes_on(10)
        cameras.make = lambda: FakeCapture(interval_s=1 / 30)
        odd.opened, odd.pictures = False, itertools.repeat(np.zeros((0, 0, 3), np.uint8))
        watched.recovers()
        survived(f"webcam gives {name}", watched)
