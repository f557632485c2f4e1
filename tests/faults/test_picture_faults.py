"""Tracker, reenactor, relighting or a provider raise or hang: something is shown all the same, and it recovers."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.camera_service import CameraTimings
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import Fallback
from relit_camera.base.errors import TrackError
from relit_camera.base.images.image_types import Frame, LinearImage
from relit_camera.base.models.session_with_fallback import Session
from relit_camera.face.face_state import FaceState
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.reenactment.first_order_reenactor import FirstOrderReenactor
from relit_camera.live.reenactment.reenactor import WarpedLayer, WarpTask
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.supervision.pipeline_health import HealthLimits
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from tests.faults.watched_camera import HANG_S, MOST_STOP_S, STOP_S, Survived, Watched
from tests.faults.watched_camera import watched_camera as unhurried_camera
from tests.small_camera import FPS, SIZE, SteadyTracker, difference, grey, memory_source, wait_until

IMPATIENT = CameraTimings(
    stop_timeout_s=STOP_S,
    pipeline=HealthLimits(retry_s=0.1, max_backoff_doublings=1, hang_timeout_s=0.4, abandon_timeout_s=1.0),
)
"""What takes seconds in life takes tenths here, and no pause grows. On a busy machine a hang may be reported that is
none: it passes with the next picture, or is followed by what the test waits for."""
MORE = 10
"""Frames that go on while there is a fault: half a second of them."""

watched_camera = partial(unhurried_camera, timings=IMPATIENT)


class FaultyTracker(SteadyTracker):
    """Raises while `error` is set, hangs while `release` is not."""

    def __init__(self) -> None:
        self.error: Exception | None = None
        self.release = threading.Event()
        self.release.set()
        self.hanging = 0

    def track(self, frame: Frame) -> FaceState:
        if self.error is not None:
            raise self.error
        if not self.release.is_set():
            self.hanging += 1
            self.release.wait(HANG_S)
            self.hanging -= 1
        return super().track(frame)


@pytest.fixture
def tracker() -> Iterator[FaultyTracker]:
    made = FaultyTracker()
    yield made
    made.release.set()


def hang(tracker: FaultyTracker, watched: Watched) -> None:
    """Let it hang, and wait until that is reported."""
    tracker.release.clear()
    wait_until(lambda: tracker.hanging > 0)
    watched.hangs("track")


@pytest.mark.parametrize("error", [ZeroDivisionError("a bug"), TrackError("a track that ends")])
def test_a_tracker_that_raises(tracker: FaultyTracker, error: Exception, tmp_path: Path, survived: Survived) -> None:
    with watched_camera(tmp_path, tracker=tracker) as watched:
        live = watched.sink.new[-1]
        tracker.error = error
        watched.reports(str(error))
        watched.state("standing-in")
        watched.goes_on(MORE)
        # The source image, at rest: the subject is where it was, lit as it was.
        assert difference(watched.sink.new[-1], live) < 6
        lit = watched.sink.new[-1]
        watched.camera.put("lighting", environment=None, lamps=[{"azimuth_deg": 90}], transition_s=0)
        wait_until(lambda: difference(watched.sink.new[-1], lit) > 5)  # the light still follows
        tracker.error = None
        watched.recovers()
        survived(f"tracker raises {type(error).__name__}", watched)


def test_a_tracker_that_hangs_for_a_while(tracker: FaultyTracker, tmp_path: Path, survived: Survived) -> None:
    with watched_camera(tmp_path, tracker=tracker) as watched:
        hang(tracker, watched)
        watched.goes_on(MORE)
        tracker.release.set()
        watched.recovers()
        survived("tracker hangs for a while", watched)


def test_a_tracker_that_hangs_for_ever_is_replaced(tracker: FaultyTracker, tmp_path: Path, survived: Survived) -> None:
    seen = threading.Event()

    def new_tracker() -> SteadyTracker:
        seen.wait(HANG_S)
        return SteadyTracker()

    with watched_camera(tmp_path, tracker=tracker, new_tracker=new_tracker) as watched:
        hang(tracker, watched)
        watched.state("standing-in")
        seen.set()
        watched.recovers()
        assert tracker.hanging == 1  # it still does
        survived("tracker hangs for ever", watched)


ROUNDS = 500_000
"""Of a hash: a fifth of a second."""


class StarvedTracker(SteadyTracker):
    """Computes for a fifth of a second a frame while `pinned` names a processor, which it may then not leave.

    Attributes:
        longest_s: how long a frame has taken at most.
    """

    def __init__(self) -> None:
        self.pinned: int | None = None
        self.longest_s = 0.0

    def track(self, frame: Frame) -> FaceState:
        if self.pinned is not None:
            anywhere, began = os.sched_getaffinity(0), time.monotonic()
            os.sched_setaffinity(0, {self.pinned})  # of this thread alone
            hashlib.pbkdf2_hmac("sha256", b"", b"", ROUNDS)  # lets the other threads run
            os.sched_setaffinity(0, anywhere)
            self.longest_s = max(self.longest_s, time.monotonic() - began)
        return super().track(frame)


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="only Linux tells who waits for a processor")
def test_a_tracker_that_starves_is_not_replaced(tmp_path: Path, survived: Survived) -> None:
    tracker, replaced = StarvedTracker(), list[SteadyTracker]()
    # However much else the machine does, it only waits.
    limits = replace(IMPATIENT.pipeline, starved_factor=1000)

    def new_tracker() -> SteadyTracker:
        replaced.append(SteadyTracker())
        return replaced[-1]

    processor = min(os.sched_getaffinity(0))
    busy = f"import os; os.sched_setaffinity(0, {{{processor}}})\nwhile True: pass"
    others: list[subprocess.Popen[bytes]] = []
    try:
        timings = replace(IMPATIENT, pipeline=limits)
        with watched_camera(tmp_path, tracker=tracker, new_tracker=new_tracker, timings=timings) as watched:
            others += [subprocess.Popen([sys.executable, "-c", busy]) for _ in range(12)]
            tracker.pinned = processor
            watched.reports("other programs keep the computer so busy")
            watched.state("standing-in")
            wait_until(lambda: tracker.longest_s > 1.5 * limits.abandon_timeout_s)
            tracker.pinned = None
            for other in others:
                other.kill()
            watched.recovers()
            assert not replaced
            survived("tracker waits for a processor, 12 busy programs on it", watched)
    finally:
        for other in others:
            other.kill()
            other.wait()


def test_trackers_that_all_hang_leave_the_fallback(tracker: FaultyTracker, tmp_path: Path, survived: Survived) -> None:
    # All have the same patience, so that the last of them has been given up long before the frames are counted.
    limits = replace(IMPATIENT.pipeline, max_backoff_doublings=0, first_frame_factor=1)
    with watched_camera(tmp_path, tracker=tracker, timings=replace(IMPATIENT, pipeline=limits)) as watched:
        tracker.release.clear()
        most = limits.max_abandoned_workers
        wait_until(lambda: tracker.hanging == most)
        watched.goes_on(round(2 * limits.abandon_timeout_s * FPS))
        assert tracker.hanging == most  # and no more
        watched.state("standing-in")
        tracker.release.set()
        watched.recovers()
        survived("every new tracker hangs", watched)


def test_what_is_late_does_not_break_a_held_picture(tracker: FaultyTracker, tmp_path: Path) -> None:
    with watched_camera(tmp_path, tracker=tracker) as watched:
        hang(tracker, watched)
        watched.camera.put("freeze", frozen=True)
        wait_until(lambda: watched.camera.camera_service._publisher.hold)  # the camera's loop has heard of it
        watched.goes_on(5)
        held, count = watched.sink.new[-1], len(watched.sink.new)
        tracker.release.set()
        wait_until(lambda: tracker.hanging == 0)
        watched.goes_on(MORE)
        assert watched.sink.new[-1] is held
        assert len(watched.sink.new) == count


def test_what_is_late_does_not_show_the_room(tracker: FaultyTracker, tmp_path: Path) -> None:
    """A frame of mode live hangs; when it comes at last the live picture is private."""
    room = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    room[..., 1] = 255
    with watched_camera(tmp_path, tracker=tracker, source=memory_source(room), look=Look(mode=Mode.LIVE)) as watched:
        hang(tracker, watched)
        watched.camera.put("mode", mode="portrait")
        watched.goes_on()  # what was on its way before
        count = len(watched.sink.new)
        tracker.release.set()
        watched.recovers()
        watched.goes_on(10)
        shown = watched.sink.new[count:]
        assert shown
        assert min(difference(picture, room) for picture in shown) > 20


def test_it_stops_in_time_while_a_tracker_hangs(tracker: FaultyTracker, tmp_path: Path) -> None:
    with watched_camera(tmp_path, tracker=tracker) as watched:
        hang(tracker, watched)
        began = time.monotonic()
        watched.camera.camera_service.stop()
        assert watched.lateness.unexplained_s(began, time.monotonic()) < MOST_STOP_S
        assert watched.camera.camera_service.hung_threads


@pytest.mark.parametrize("half", ["follow", "move"])
@pytest.mark.parametrize("how", ["raises", "hangs"])
def test_a_reenactor(half: str, how: str, tmp_path: Path, survived: Survived, monkeypatch: pytest.MonkeyPatch) -> None:
    healthy = FirstOrderReenactor.plan_warp
    fault, hit, released = threading.Event(), threading.Event(), threading.Event()

    def fail() -> None:
        if fault.is_set():
            hit.set()
            if how == "raises":
                raise FloatingPointError("a bug in the warp")
            released.wait(HANG_S)

    def plan_warp(self: FirstOrderReenactor, motion: FaceMotion, frame: Frame, quality: RenderQuality) -> WarpTask:
        if half == "follow":
            fail()
        move = healthy(self, motion, frame, quality)

        def faulty(relit: LinearImage) -> WarpedLayer:
            fail()
            return move(relit)

        return faulty if half == "move" else move

    monkeypatch.setattr(FirstOrderReenactor, "plan_warp", plan_warp)
    with watched_camera(tmp_path) as watched:
        fault.set()
        wait_until(hit.is_set)
        if how == "raises":
            watched.reports("a bug in the warp")
        else:
            watched.hangs(half)
        watched.state("standing-in")
        watched.goes_on(MORE)
        fault.clear()
        released.set()
        watched.recovers()
        survived(f"reenactor {how} ({half})", watched)


@pytest.mark.parametrize("fallback", list(Fallback))
def test_not_even_the_source_image_can_be_relit(
    fallback: Fallback, tmp_path: Path, survived: Survived, monkeypatch: pytest.MonkeyPatch
) -> None:
    with watched_camera(tmp_path, fallback=fallback, unlit_allowed=fallback is Fallback.FILMED) as watched:

        def fail(self: BasisRelighter, lights: object) -> LinearImage:
            raise MemoryError("no memory for a picture")

        with monkeypatch.context() as broken:
            broken.setattr(BasisRelighter, "relight", fail)
            watched.camera.put("lighting", environment="sunset", transition_s=0)
            watched.reports("no memory for a picture")
            failed = placeholder(SIZE, "the picture has failed: see the panel")
            shown = grey() if fallback is Fallback.FILMED else failed
            wait_until(lambda: difference(watched.sink.new[-1], shown) == 0)
            watched.goes_on(MORE)
        watched.recovers()
        survived(f"relighting raises, output.fallback is {fallback}", watched)


def test_a_provider_that_fails_on_the_way(tmp_path: Path, survived: Survived, monkeypatch: pytest.MonkeyPatch) -> None:
    healthy = Session._run
    fault = threading.Event()

    def run(self: Session, feeds: object) -> dict[str, np.ndarray]:
        if fault.is_set():
            raise RuntimeError("CUDA failure 719: unspecified launch failure")
        return healthy(self, feeds)  # type: ignore[arg-type]

    monkeypatch.setattr(Session, "_run", run)
    with watched_camera(tmp_path) as watched:
        fault.set()
        watched.reports("719")
        watched.goes_on(MORE)
        fault.clear()
        watched.recovers()
        survived("the network's provider fails", watched)
