"""A source that is open only while it is wanted: alone, and in a running camera."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from relit_camera.base.errors import ConfigError, DeviceError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.on_demand.on_demand_source import DemandMonitor, OnDemandController, OnDemandSource
from relit_camera.devices.sinks.sink import SinkInfo
from relit_camera.devices.sources.source import SourceInfo, SourceState
from relit_camera.devices.sources.webcam_source import WebcamSource
from relit_camera.live.publishing.placeholder_image import placeholder
from tests.devices.fake_devices import FakeCapture, FakeTree
from tests.small_camera import SIZE, difference, grey, running_camera, wait_until


class CountingSource:
    """Gives frames at once; remembers whether it was read and closed."""

    def __init__(self):
        self.state, self.reason, self.index, self.closed = SourceState.IDLE, "", -1, False

    def read(self, timeout_s):
        time.sleep(0.01)
        self.state = SourceState.RUNNING
        self.index += 1
        return Frame(grey(), self.index, time.monotonic(), self.index / 100)

    def describe(self):
        return SourceInfo("webcam", "fake", SIZE, 100.0)

    def close(self):
        self.closed = True


class Cameras:
    """Makes sources, and keeps them all."""

    def __init__(self):
        self.made: list[CountingSource] = []
        self.error: Exception | None = None

    def __call__(self):
        if self.error is not None:
            raise self.error
        self.made.append(CountingSource())
        return self.made[-1]


class Switch:
    on = False

    def __call__(self):
        return self.on


@pytest.fixture
def parts():
    cameras, wanted = Cameras(), Switch()
    return cameras, wanted, OnDemandSource(cameras(), cameras, wanted)


def test_it_begins_released_and_reads_nothing(parts):
    cameras, _, source = parts
    assert source.read(0.01) is None
    assert (source.state, source.reason) == (SourceState.RELEASED, "")
    assert cameras.made[0].state is SourceState.IDLE
    assert source.describe().id == "fake"


def test_it_opens_when_wanted_closes_when_not_and_opens_anew(parts):
    cameras, wanted, source = parts
    wanted.on = True
    assert source.read(0.1) is not None
    assert source.state is SourceState.RUNNING
    assert len(cameras.made) == 1
    wanted.on = False
    assert source.read(0.01) is None
    assert cameras.made[0].closed
    assert source.state is SourceState.RELEASED
    wanted.on = True
    assert source.read(0.1) is not None
    assert len(cameras.made) == 2
    assert not cameras.made[1].closed


def test_indices_and_times_grow_through_pauses(parts):
    _, wanted, source = parts
    frames = []
    for on in (True, False, True, False, True):
        wanted.on = on
        frames += [source.read(0.01) for _ in range(4)]
    given = [frame for frame in frames if frame is not None]
    assert [frame.index for frame in given] == list(range(12))
    times = [frame.time_s for frame in given]
    assert times == sorted(times)


def test_a_camera_that_went_away_meanwhile_is_looked_for(parts, monkeypatch):
    monkeypatch.setattr("relit_camera.devices.on_demand.on_demand_source.RETRY_S", 0.0)
    cameras, wanted, source = parts
    wanted.on = True
    source.read(0.1)
    wanted.on = False
    source.read(0.01)
    wanted.on, cameras.error = True, DeviceError("there is no webcam 'fake'", "plug it in")
    assert source.read(0.01) is None
    assert (source.state, source.reason) == (SourceState.RECONNECTING, "there is no webcam 'fake'")
    cameras.error = None
    assert source.read(0.1) is not None
    assert source.reason == ""


def test_closing_ends_it_for_good(parts):
    cameras, wanted, source = parts
    wanted.on = True
    source.read(0.1)
    source.close()
    source.close()
    assert cameras.made[0].closed
    assert source.read(0.5) is None
    assert source.state is SourceState.ENDED
    assert len(cameras.made) == 1


def test_a_webcam_is_really_let_go(tmp_path: Path):
    tree = FakeTree(tmp_path)
    tree.add_webcam(0, "Cam")
    captures: list[FakeCapture] = []

    def open_capture(*_):
        captures.append(FakeCapture())
        return captures[-1]

    def webcam():
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
        assert captures[-1].released
    source.close()


# In a running camera.


class Sink:
    def __init__(self, kind, node=""):
        self.info = SinkInfo(kind, node, SIZE)

    def describe(self):
        return self.info


def test_a_file_is_always_wanted_and_null_by_viewers_alone():
    cameras = Cameras()
    recording = OnDemandController(cameras(), cameras, Sink("file", "out.mp4")).source
    assert recording.read(0.1) is not None
    nowhere = OnDemandController(cameras(), cameras, Sink("null"))
    assert nowhere.source.read(0.01) is None
    nowhere.note_viewer()
    assert nowhere.source.read(0.1) is not None


def test_another_system_says_that_it_cannot(monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(ConfigError, match="only Linux"):
        OnDemandController(CountingSource(), Cameras(), Sink("camera", "OBS"))


def test_the_camera_lives_on_while_its_webcam_is_released(tmp_path: Path):
    cameras, readers = Cameras(), Switch()
    demand = DemandMonitor(readers, idle_timeout_s=0.3)
    source = OnDemandSource(cameras(), cameras, demand.wanted)
    released = placeholder(SIZE, "the webcam is off until somebody looks")
    with running_camera(tmp_path, source=source) as camera:
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


def test_a_preview_or_snapshot_tells_of_a_viewer(tmp_path: Path):
    seen: list[int] = []
    with running_camera(tmp_path, on_viewer=lambda: seen.append(1)) as camera:
        assert camera.http.get("status").status_code == 200
        assert seen == []
        assert camera.http.get("snapshot.jpg").status_code == 200
        assert seen
