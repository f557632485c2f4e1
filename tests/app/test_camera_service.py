"""The running camera: changes over HTTP reach the next frames, and whatever fails, pictures keep coming."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue

import httpx
import numpy as np
import pytest

from relit_camera.base.config.look import Look, Mode
from relit_camera.base.errors import VideoError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.models.model_store import FOLDER_VARIABLE
from relit_camera.devices.sources.source import SourceInfo, SourceState, ThreadedSource
from relit_camera.face.face_state import LOST, FaceState
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.live.supervision import pipeline_supervisor
from relit_camera.live.supervision.camera_loop import LoopTimings
from tests.lateness import Lateness
from tests.small_camera import (
    FPS,
    PATIENT,
    SIZE,
    WAIT_S,
    RememberingSink,
    SteadyTracker,
    difference,
    grey,
    memory_source,
    running_camera,
    wait_until,
)
from tests.virtual_clock import VirtualClock

LAMP_LEFT = {"azimuth_deg": -90, "elevation_deg": 0, "intensity": 1.5}
LAMP_RIGHT = {"azimuth_deg": 90, "elevation_deg": 0, "intensity": 1.5}


def sides(picture: np.ndarray) -> float:
    """How much brighter the right half is than the left, code values."""
    half = picture.shape[1] // 2
    return float(picture[:, half:].mean() - picture[:, :half].mean())


class SteppedSource(ThreadedSource):
    """Gives a frame each time that it is told to."""

    def __init__(self, picture: DisplayImage | None = None) -> None:
        super().__init__(SourceInfo("still", "memory", SIZE, FPS))
        self._picture = grey() if picture is None else picture
        self._times, self._time_s = SimpleQueue[float | None](), 0.0

    def step(self, sink: RememberingSink, seconds: float = 1 / FPS) -> DisplayImage:
        """Give a frame so long after the last one; returns its picture."""
        known = len(sink.new)
        self._time_s += seconds
        self._times.put(self._time_s)
        sink.wait_for(known + 1)
        return sink.new[known]

    def close(self) -> None:
        self._times.put(None)
        super().close()

    def _produce(self) -> None:
        for index, time_s in enumerate(iter(self._times.get, None)):
            self._publish(Frame(self._picture, index, time.monotonic(), time_s))


@pytest.fixture
def full_quality(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are not made cheaper where a busy machine makes them late."""
    monkeypatch.setattr(pipeline_supervisor, "next_quality", lambda state, *_: state)


@pytest.mark.usefixtures("full_quality")
def test_a_change_of_light_is_whole_in_the_next_frame(tmp_path: Path) -> None:
    source = SteppedSource()
    with running_camera(tmp_path, source, timings=PATIENT) as camera:
        camera.sink.wait_for(1)  # the placeholder
        for lamp, sign in ((LAMP_LEFT, -1), (LAMP_RIGHT, 1), (LAMP_LEFT, -1)):
            source.step(camera.sink)
            camera.put("lighting", environment=None, lamps=[lamp], transition_s=0)
            after = source.step(camera.sink)
            assert sign * sides(after) > 10
            assert difference(after, source.step(camera.sink)) == 0


@pytest.mark.slow
@pytest.mark.usefixtures("full_quality")
def test_an_eased_change_begins_in_the_next_frame(tmp_path: Path) -> None:
    source = SteppedSource()
    with running_camera(tmp_path, source, timings=PATIENT) as camera:
        camera.sink.wait_for(1)  # the placeholder
        before = source.step(camera.sink)
        camera.put("lighting", environment="studio", exposure_ev=-2)
        pictures = [source.step(camera.sink) for _ in range(int(FPS / 2))]
        shown = [difference(before, picture) for picture in pictures]
        assert shown[0] > 2
        assert shown[0] < 0.95 * shown[-1]
        assert difference(pictures[-1], pictures[-2]) == 0
        assert (np.diff(shown) >= 0).all()


def test_status_says_what_runs(tmp_path: Path) -> None:
    with running_camera(tmp_path, timings=PATIENT) as camera:
        wait_until(lambda: camera.status()["state"] == "live" and camera.camera_service.status().fps.pipeline > FPS / 3)
        wait_until(lambda: camera.camera_service.status().latency_ms.p50 > 0)  # it is published a little later
        status = camera.status()
        assert status["subject"] == "small"
        assert status["source"] == "still memory"
        assert status["tracker"] == {"name": "nodding", "state": "found"}
        assert camera.degraded() == set()
        assert status["light"] == {"measured": 1, "behind": 0, "softened": 0}  # lit from all sides for its capture
        assert {"track", "light", "relight", "follow", "move", "compose"} <= status["stage_ms"].keys()  # type: ignore[attr-defined]
        found = camera.camera_service.status()
        assert 0 < found.latency_ms.p50 <= found.latency_ms.p95
        assert found.frames.published >= found.frames.repeated >= 0
        wait_until(lambda: camera.camera_service.status().fps.published == pytest.approx(FPS, rel=0.35))


class SlowTracker(SteadyTracker):
    def track(self, frame: Frame) -> FaceState:
        time.sleep(3 / FPS)
        return super().track(frame)


@pytest.mark.slow
def test_a_slow_pipeline_is_not_taken_for_a_slow_camera(tmp_path: Path) -> None:
    with running_camera(tmp_path, tracker=SlowTracker(), timings=PATIENT) as camera:
        wait_until(
            lambda: (
                camera.camera_service.status().frames.dropped > 8 and camera.camera_service.status().fps.pipeline > 0
            )
        )
        status = camera.camera_service.status()
        assert status.fps.camera > 1.8 * status.fps.pipeline > 0


@pytest.mark.slow
def test_frozen_holds_the_picture_for_as_long_as_it_is_asked_to(tmp_path: Path) -> None:
    with running_camera(tmp_path, timings=replace(PATIENT, stale_after_s=0.5)) as camera:
        camera.sink.wait_for(3)
        camera.put("freeze", frozen=True)
        wait_until(lambda: camera.status()["state"] == "frozen")
        begun = camera.sink.count
        wait_until(lambda: camera.sink.count >= begun + 3)  # what was on its way
        held, count = camera.sink.new[-1], camera.sink.count
        camera.put("lighting", environment=None, lamps=[LAMP_LEFT], transition_s=0)
        wait_until(lambda: camera.sink.count > count + 0.8 * FPS)  # for longer than `stale_after_s`
        assert camera.sink.new[-1] is held
        camera.put("freeze", frozen=False)
        wait_until(lambda: difference(camera.sink.new[-1], held) > 5)
        assert camera.status()["state"] == "live"


def test_while_the_picture_is_frozen_the_computer_is_not_said_to_be_slow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = VirtualClock()
    monkeypatch.setattr("relit_camera.app.camera_service.SYSTEM_CLOCK", clock)  # tells for how long it is slow
    with running_camera(tmp_path, timings=PATIENT) as camera:
        camera.sink.wait_for(3)
        camera.put("freeze", frozen=True)
        wait_until(lambda: (fps := camera.camera_service.status().fps).new < fps.camera / 4)
        for _ in range(3):
            clock.sleep(4)
            assert camera.camera_service.status().advice is None


class FailingTracker(SteadyTracker):
    """Raises for some frames, as a fault of ours would."""

    fails = False

    def track(self, frame: Frame) -> FaceState:
        if self.fails:
            raise ZeroDivisionError("a fault in one frame")
        return super().track(frame)


IMPATIENT = replace(PATIENT, loop=LoopTimings(source_retry_s=0.1), pipeline=replace(PATIENT.pipeline, retry_s=0.1))


@pytest.mark.slow
def test_a_frame_that_raises_does_not_stop_publishing(tmp_path: Path) -> None:
    tracker = FailingTracker()
    with running_camera(tmp_path, tracker=tracker, timings=IMPATIENT) as camera:
        camera.sink.wait_for(3)
        tracker.fails = True
        wait_until(lambda: "a fault in one frame" in camera.troubles())
        assert "fault of ours" in camera.troubles()
        assert camera.degraded() == {DegradationCode.PICTURE_FAILED}
        count = camera.sink.count
        wait_until(lambda: camera.sink.count > count + 3)
        tracker.fails = False
        wait_until(lambda: camera.troubles() == "")
        camera.sink.wait_for(len(camera.sink.new) + 2)


class NoFaceTracker(SteadyTracker):
    def track(self, frame: Frame) -> FaceState:
        return LOST


def test_without_a_face_it_searches_and_shows_the_source_image(tmp_path: Path) -> None:
    with running_camera(tmp_path, tracker=NoFaceTracker(), timings=PATIENT) as camera:
        wait_until(lambda: camera.status()["state"] == "searching")
        assert camera.sink.new[-1].std() > 5
        assert camera.troubles() == ""


@pytest.mark.slow
def test_a_source_that_ends_leaves_the_placeholder(tmp_path: Path) -> None:
    with running_camera(tmp_path, source=memory_source(count=8), timings=replace(PATIENT, stale_after_s=0.3)) as camera:
        wait_until(lambda: camera.status()["state"] == "waiting")
        waiting = placeholder(SIZE, "waiting for the camera")
        wait_until(lambda: difference(camera.sink.new[-1], waiting) == 0)
        count = camera.sink.count
        wait_until(lambda: camera.sink.count > count + 3)


class BrokenSource:
    """A real source whose file turns out to be damaged after some frames."""

    def __init__(self) -> None:
        self._inner = memory_source()
        self.error: Exception | None = None

    def read(self, timeout_s: float) -> Frame | None:
        if self.error is not None:
            raise self.error
        return self._inner.read(timeout_s)

    def __getattr__(self, name: str) -> object:
        return getattr(self._inner, name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "cure"),
    [(VideoError("clip.mp4 is damaged", "copy it again"), "copy it again"), (KeyError("x"), "a fault of ours")],
)
def test_a_source_that_fails_is_reported_with_its_cure(error: Exception, cure: str, tmp_path: Path) -> None:
    source = BrokenSource()
    with running_camera(tmp_path, source=source, timings=IMPATIENT) as camera:  # type: ignore[arg-type]
        camera.sink.wait_for(3)
        source.error = error
        wait_until(lambda: cure in camera.troubles())
        assert camera.degraded() == {DegradationCode.SOURCE_FAILED}
        count = camera.sink.count
        wait_until(lambda: camera.sink.count > count + 3)
        source.error = None
        wait_until(lambda: camera.troubles() == "")


class SilentSource(BrokenSource):
    """A camera that another program holds: it never gives a frame and says why."""

    state = SourceState.RECONNECTING
    reason = "HD Webcam cannot be opened: another program may be using it"

    def read(self, timeout_s: float) -> Frame | None:
        time.sleep(0.01)
        return None


def test_a_camera_that_never_came_is_reported_and_waited_for(tmp_path: Path) -> None:
    source = SilentSource()
    with running_camera(tmp_path, source=source, timings=PATIENT) as camera:  # type: ignore[arg-type]
        wait_until(lambda: "another program may be using it" in camera.troubles())
        wait_until(lambda: camera.status()["state"] == "waiting")
        assert "relit devices" in camera.troubles()
        wait_until(lambda: difference(camera.sink.new[-1], placeholder(SIZE, "waiting for the camera")) == 0)
        source.reason = "HD Webcam is unplugged"
        wait_until(lambda: "is unplugged" in camera.troubles())


@pytest.mark.slow
def test_ready_while_the_picture_is_held(tmp_path: Path) -> None:
    with running_camera(tmp_path, timings=PATIENT) as camera:
        camera.sink.wait_for(3)
        camera.put("freeze", frozen=True)
        wait_until(lambda: camera.status()["state"] == "frozen")
        count = camera.sink.count
        wait_until(lambda: camera.sink.count > count + 2)
        assert httpx.get(camera.http.base_url.join("/readyz")).json() == {"status": "ready"}


@pytest.mark.slow
def test_a_missing_matte_model_is_reported_and_pictures_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "no-models"))
    with running_camera(tmp_path, look=Look(mode=Mode.LIVE), timings=IMPATIENT) as camera:
        camera.sink.wait_for(3)
        camera.put("background", kind="blur")
        wait_until(lambda: "relit models pull" in camera.troubles())
        count = camera.sink.count
        wait_until(lambda: camera.sink.count > count + 3)
        camera.put("background", kind="none")
        wait_until(lambda: camera.troubles() == "")


def test_stop_ends_every_thread(tmp_path: Path) -> None:
    before = set(threading.enumerate())
    timings = replace(PATIENT, stop_timeout_s=WAIT_S)  # nothing is left to itself
    with Lateness() as lateness, running_camera(tmp_path, timings=timings) as camera:
        camera.sink.wait_for(2)
        began = time.monotonic()
        camera.camera_service.stop()
        assert lateness.unexplained_s(began, time.monotonic()) < 3
        assert camera.camera_service.hung_threads == []
        assert camera.camera_service.stopping()
        assert camera.camera_service.status().state == "stopping"
        camera.camera_service.stop()
    wait_until(lambda: not set(threading.enumerate()) - before)
