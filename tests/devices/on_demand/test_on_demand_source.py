"""A source that is open only while it is wanted: alone, and in a running camera."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import ConfigError, DeviceError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.on_demand.on_demand_source import DemandMonitor, DemandWatch, OnDemandSource
from relit_camera.devices.sinks.sink import NullSink, SinkInfo
from relit_camera.devices.sources.source import SourceInfo, SourceState
from relit_camera.devices.sources.webcam_source import WebcamSource
from relit_camera.live.publishing.placeholder_image import placeholder
from tests.devices.fake_devices import FakeCapture, FakeTree
from tests.small_camera import PATIENT, SIZE, difference, grey, running_camera, wait_until
from tests.virtual_clock import VirtualClock


class CountingSource:
    """Gives a frame a hundredth of a second; remembers whether it was read and closed."""

    reason = ""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.state, self.index, self.closed = SourceState.IDLE, -1, False

    def read(self, timeout_s: float) -> Frame | None:
        self._clock.wait(threading.Event(), 0.01)
        self.state = SourceState.RUNNING
        self.index += 1
        return Frame(grey(), self.index, self._clock.now(), self.index / 100)

    def describe(self) -> SourceInfo:
        return SourceInfo("webcam", "fake", SIZE, 100.0)

    def close(self) -> None:
        self.closed = True


class Cameras:
    """Makes sources, and keeps them all."""

    def __init__(self, clock: Clock = SYSTEM_CLOCK) -> None:
        self.clock = clock
        self.made: list[CountingSource] = []
        self.calls = 0
        self.error: Exception | None = None

    def __call__(self) -> CountingSource:
        self.calls += 1
        if self.error is not None:
            raise self.error
        self.made.append(CountingSource(self.clock))
        return self.made[-1]


class Switch:
    on = False

    def __call__(self) -> bool:
        return self.on


class OnDemand:
    """A source on demand in virtual time.

    Attributes:
        cameras: made the sources that it wraps.
        wanted: switches it on and off.
    """

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.cameras, self.wanted = Cameras(self.clock), Switch()
        self.source = OnDemandSource(self.cameras(), self.cameras, self.wanted, self.clock)

    def read(self, on: bool, timeout_s: float = 0.1) -> Frame | None:
        self.wanted.on = on
        return self.source.read(timeout_s)


@pytest.fixture
def on_demand() -> OnDemand:
    return OnDemand()


def test_it_begins_released_and_reads_nothing(on_demand: OnDemand) -> None:
    before = on_demand.clock.now()
    assert on_demand.read(False, 0.2) is None
    assert on_demand.clock.now() == before + 0.2  # it waits, as a source without frames does
    assert (on_demand.source.state, on_demand.source.reason) == (SourceState.RELEASED, "")
    assert on_demand.cameras.made[0].state is SourceState.IDLE
    assert on_demand.source.describe().id == "fake"


def test_it_opens_when_wanted_closes_when_not_and_opens_anew(on_demand: OnDemand) -> None:
    made = on_demand.cameras.made
    assert on_demand.read(True) is not None
    assert on_demand.source.state is SourceState.RUNNING
    assert len(made) == 1
    assert on_demand.read(False) is None
    assert made[0].closed
    assert on_demand.source.state is SourceState.RELEASED
    assert on_demand.read(True) is not None
    assert len(made) == 2
    assert not made[1].closed


def test_indices_and_times_go_on_through_pauses(on_demand: OnDemand) -> None:
    given: list[Frame] = []
    for on in (True, False, True, False, True):
        for _ in range(4):
            frame = on_demand.read(on, timeout_s=10.0)
            if frame is not None:
                given.append(frame)
    assert [frame.index for frame in given] == list(range(12))
    steps = np.diff([frame.time_s for frame in given])
    assert (steps > 0).all()
    assert (steps > 39).sum() == 2  # four reads of ten seconds without a frame


def test_a_camera_that_went_away_meanwhile_is_looked_for_at_each_read(on_demand: OnDemand) -> None:
    on_demand.read(True)
    on_demand.read(False)
    on_demand.cameras.error = DeviceError("there is no webcam 'fake'", "plug it in")
    for _ in range(3):
        with pytest.raises(DeviceError, match="there is no webcam 'fake'; plug it in"):
            on_demand.read(True)
    assert on_demand.read(False) is None  # nobody looks for it any more
    on_demand.cameras.error = None
    assert on_demand.read(True) is not None


def test_a_source_that_is_open_already_is_closed_if_nobody_wants_it() -> None:
    clock = VirtualClock()
    cameras = Cameras(clock)
    source = OnDemandSource(cameras(), cameras, lambda: False, clock, is_open=True)
    assert source.read(0.1) is None
    assert cameras.made[0].closed


def test_closing_ends_it_for_good(on_demand: OnDemand) -> None:
    on_demand.read(True)
    on_demand.source.close()
    on_demand.source.close()
    assert on_demand.cameras.made[0].closed
    assert on_demand.read(True) is None
    assert on_demand.source.state is SourceState.ENDED
    assert len(on_demand.cameras.made) == 1


def test_a_webcam_is_really_closed(tmp_path: Path) -> None:
    tree = FakeTree(tmp_path)
    tree.add_webcam(0, "Cam")
    captures: list[FakeCapture] = []

    def open_capture(*_: object) -> FakeCapture:
        captures.append(FakeCapture())
        return captures[-1]

    def webcam() -> WebcamSource:
        return WebcamSource("webcam", SIZE, 30.0, tree=tree, open_capture=open_capture)

    wanted = Switch()
    source = OnDemandSource(webcam(), webcam, wanted)
    source.read(0.05)
    assert captures == []  # its light never came on
    for turn in (1, 2):
        wanted.on = True
        wait_until(lambda: source.read(0.1) is not None)
        assert len(captures) == turn
        wanted.on = False
        source.read(0.01)
        wait_until(lambda: captures[-1].released)
    source.close()


# In a running camera.


class NamedSink(NullSink):
    """Says that it is a sink of some kind."""

    def __init__(self, kind: str, node: str = "") -> None:
        super().__init__(SIZE)
        self.info = SinkInfo(kind, node, SIZE)

    def describe(self) -> SinkInfo:
        return self.info


def test_a_file_is_always_wanted_and_null_by_viewers_alone() -> None:
    assert DemandWatch(NamedSink("file", "out.mp4")).wanted()
    nowhere = DemandWatch(NamedSink("null"))
    assert not nowhere.wanted()
    nowhere.note_viewer()
    assert nowhere.wanted()


def test_another_system_says_that_it_cannot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(ConfigError, match="only Linux"):
        DemandWatch(NamedSink("camera", "OBS"))


@pytest.mark.slow
def test_the_camera_lives_on_while_its_webcam_is_released(tmp_path: Path) -> None:
    cameras, readers = Cameras(), Switch()
    demand = DemandMonitor(readers, idle_timeout_s=0.3)
    source = OnDemandSource(cameras(), cameras, demand.wanted)
    released = placeholder(SIZE, "the webcam is off until somebody looks")
    with running_camera(tmp_path, source=source, timings=replace(PATIENT, stale_after_s=0.5)) as camera:
        wait_until(lambda: camera.status()["state"] == "released")
        wait_until(lambda: difference(camera.sink.new[-1], released) == 0)
        assert camera.status()["degraded"] == []
        published = camera.camera_service.status().frames.published
        wait_until(
            lambda: camera.camera_service.status().frames.published > published + 5
        )  # readers find a live camera

        readers.on = True
        wait_until(lambda: camera.status()["state"] == "live")
        readers.on = False
        wait_until(lambda: camera.status()["state"] == "released")
        assert cameras.made[0].closed
        wait_until(lambda: difference(camera.sink.new[-1], released) == 0)

        readers.on = True
        wait_until(lambda: camera.status()["state"] == "live")
        assert len(cameras.made) == 2

        readers.on = False
        wait_until(lambda: camera.status()["state"] == "released")
        given = sum(made.index + 1 for made in cameras.made)

        def shown_or_dropped() -> int:
            frames = camera.camera_service.status().frames
            return frames.published - frames.repeated + frames.dropped

        wait_until(lambda: shown_or_dropped() == given)  # each once: the new source's count goes on


def test_a_preview_or_snapshot_counts_as_a_viewer(tmp_path: Path) -> None:
    seen: list[int] = []
    with running_camera(tmp_path, on_viewer=lambda: seen.append(1)) as camera:
        assert camera.http.get("status").status_code == 200
        assert seen == []
        assert camera.http.get("snapshot.jpg").status_code == 200
        assert seen
