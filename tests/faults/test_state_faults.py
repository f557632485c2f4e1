"""Files that the camera uses are spoilt, the clock jumps, the sink fails or hangs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.camera_service import CameraTimings
from relit_camera.base.errors import DeviceError, StorageError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.devices.sinks.sink import SinkInfo
from relit_camera.devices.sources.playback_source import PlaybackSource, TimedImage
from relit_camera.devices.sources.source import SourceInfo
from relit_camera.face.face_state import FaceState
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.supervision.pipeline_health import HealthLimits
from relit_camera.subject.subject_file import write_subject
from tests.faults.watched_camera import HANG_S, MOST_STOP_S, STOP_S, Survived, TimedSink, watched_camera
from tests.generated_subject import small_subject
from tests.lateness import Lateness
from tests.small_camera import (
    FPS,
    PATIENT,
    SIZE,
    WAIT_S,
    SteadyTracker,
    difference,
    grey,
    memory_source,
    running_camera,
    wait_until,
)

SOON_STALE = CameraTimings(stale_after_s=0.3)
SOON_STOPPED = CameraTimings(stop_timeout_s=STOP_S)


def overwritten(path: Path) -> None:
    path.write_bytes(b"garbage" * 1000)


def cut_short(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(100)


def replaced(path: Path) -> None:
    other = path.with_suffix(".new")
    other.write_bytes(b"\\0" * 5000)
    other.replace(path)


def deleted(path: Path) -> None:
    path.unlink()


@pytest.mark.parametrize("spoil", [overwritten, cut_short, replaced, deleted], ids=lambda f: f.__name__)
def test_a_subject_file_is_spoilt_while_in_use(
    spoil: Callable[[Path], None], tmp_path: Path, survived: Survived
) -> None:
    file = tmp_path / "me.relit"
    write_subject(file, small_subject())
    with watched_camera(tmp_path / "data", timings=PATIENT) as watched:
        watched.camera.scene_controller.load_configured_subject(str(file))
        watched.goes_on(10)
        watched.begin()
        spoil(file)
        # Every picture of the field is asked for again under another light.
        for azimuth in (-90, 90):
            before = watched.sink.new[-1]
            watched.camera.put("lighting", environment=None, lamps=[{"azimuth_deg": azimuth}], transition_s=0)
            wait_until(lambda before=before: difference(watched.sink.new[-1], before) > 2)  # type: ignore[misc]
            watched.goes_on(10)
        assert watched.reports_nothing()
        survived(f"subject file {spoil.__name__.replace('_', ' ')} while in use", watched)


@pytest.mark.parametrize("jump_s", [-7200.0, 86400.0 * 365])
def test_the_clock_jumps(jump_s: float, tmp_path: Path, survived: Survived, monkeypatch: pytest.MonkeyPatch) -> None:
    real = time.time
    with watched_camera(tmp_path, timings=PATIENT) as watched:
        monkeypatch.setattr(time, "time", lambda: real() + jump_s)
        watched.goes_on(20)
        assert watched.reports_nothing()
        assert 0 < watched.camera.camera_service.status().latency_ms.p95 < 1e3 * WAIT_S
        survived(f"the clock jumps by {jump_s / 3600:+.0f} h", watched)


class FaultySink(TimedSink):
    """Raises while `error` is set, hangs (as `is_stuck` says then) while `release` is not; counts only what it took."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.error: Exception | None = None
        self.release, self.is_stuck = threading.Event(), threading.Event()
        self.release.set()

    def write(self, image: DisplayImage) -> None:
        if self.error is not None:
            raise self.error
        if not self.release.is_set():
            self.is_stuck.set()
            self.release.wait(HANG_S)
        super().write(image)

    def hang(self) -> None:
        """Hang from now on, until it is released; wait until it does."""
        self.release.clear()
        wait_until(self.is_stuck.is_set)


def test_the_virtual_camera_is_gone_for_a_while(tmp_path: Path) -> None:
    sink = FaultySink()
    with running_camera(tmp_path, sink=sink) as camera:
        sink.wait_for(3)
        sink.error = DeviceError("the virtual camera is gone", "load the module")
        wait_until(lambda: "load the module" in camera.troubles())
        sink.error = None
        count = sink.count
        wait_until(lambda: sink.count > count + 5 and camera.troubles() == "")


def test_it_stops_in_time_while_the_driver_hangs(tmp_path: Path) -> None:
    sink = FaultySink()
    with Lateness() as lateness, running_camera(tmp_path, sink=sink, timings=SOON_STOPPED) as camera:
        sink.wait_for(3)
        sink.hang()
        began = time.monotonic()
        camera.camera_service.stop()
        assert lateness.unexplained_s(began, time.monotonic()) < MOST_STOP_S
        wait_until(lambda: camera.camera_service.hung_threads == ["publisher"])
        sink.release.set()


def test_the_end_of_a_recording_is_waited_for(tmp_path: Path) -> None:
    """A disk that is slow to answer costs time, one that does not answer costs the recording: neither is silent."""

    class Recording(FaultySink):
        def describe(self) -> SinkInfo:
            return SinkInfo("file", "rec.mp4", SIZE)

    for disk_timeout_s, lost in ((WAIT_S, False), (0.5, True)):
        timings = CameraTimings(stop_timeout_s=0.5, disk_timeout_s=disk_timeout_s)
        sink = Recording()
        with ExitStack() as ended:
            if lost:
                ended.enter_context(pytest.raises(StorageError, match="the disk does not answer"))
            with running_camera(tmp_path, sink=sink, timings=timings) as camera:
                sink.wait_for(3)
                sink.hang()
                if not lost:
                    threading.Timer(3 * timings.stop_timeout_s, sink.release.set).start()
                camera.camera_service.stop()
        sink.release.set()


def test_a_picture_that_gave_way_does_not_come_back_by_holding(tmp_path: Path) -> None:
    waiting = placeholder(SIZE, "waiting for the camera")
    with running_camera(tmp_path, source=memory_source(count=8), timings=SOON_STALE) as camera:
        wait_until(lambda: difference(camera.sink.new[-1], waiting) == 0 and camera.status()["state"] == "waiting")
        for frozen in (True, False):
            camera.put("freeze", frozen=frozen)
            count = camera.sink.count
            wait_until(lambda count=count: camera.sink.count > count + 20)  # type: ignore[misc]
            assert difference(camera.sink.new[-1], waiting) == 0


class LateTracker(SteadyTracker):
    """Hangs while `release` is not set."""

    def __init__(self) -> None:
        self.release = threading.Event()
        self.release.set()

    def track(self, frame: Frame) -> FaceState:
        self.release.wait(HANG_S)
        return super().track(frame)


def test_a_late_picture_does_not_replace_the_placeholder(tmp_path: Path) -> None:
    waiting = placeholder(SIZE, "waiting for the camera")
    tracker, more = LateTracker(), threading.Event()

    def play() -> Iterator[TimedImage]:
        yield grey(), 0.0
        more.wait(HANG_S)
        yield grey(), 1 / FPS

    source = PlaybackSource(SourceInfo("still", "memory", SIZE, FPS), play())
    with running_camera(tmp_path, source=source, tracker=tracker, timings=SOON_STALE) as camera:
        wait_until(lambda: camera.status()["state"] == "live")
        tracker.release.clear()
        more.set()
        wait_until(lambda: difference(camera.sink.new[-1], waiting) == 0 and camera.status()["state"] == "waiting")
        with camera.camera_service.events.listen() as events:
            shown, count = len(camera.sink.new), camera.sink.count
            tracker.release.set()
            wait_until(lambda: camera.camera_service.status().frames.dropped == 1)
            wait_until(lambda: camera.sink.count > count + 20)
            assert len(camera.sink.new) == shown
            assert events.empty()  # nor is it said to be live


def test_a_tracker_made_anew_may_fail_too(tmp_path: Path) -> None:
    """Its model was deleted meanwhile: the fallback is shown, and the status says why."""
    from relit_camera.base.errors import ModelError

    class Broken(SteadyTracker):
        def track(self, frame: Frame) -> FaceState:
            raise ZeroDivisionError("a bug")

    def renew() -> SteadyTracker:
        raise ModelError("the face model is missing", "run `relit models pull`")

    soon = CameraTimings(pipeline=HealthLimits(retry_s=0.1))
    with running_camera(tmp_path, sink=TimedSink(), tracker=Broken(), new_tracker=renew, timings=soon) as camera:
        wait_until(lambda: "relit models pull" in camera.troubles())
        assert np.ptp(camera.sink.new[-1]) > 0
