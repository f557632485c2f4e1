"""When frames are judged, by whom it is heard, and that nothing is done while nobody wants it."""

from __future__ import annotations

import threading
from typing import cast

import numpy as np
import pytest

from relit_camera.base.errors import ModelError, NotReadyError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.detection.face_detector import FaceDetector
from relit_camera.face.framing.framing import FaceCount, Framing, FramingItem, FramingState
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.supervision.framing_monitor import ANSWER_S, PERIOD_S, WANTED_S, FramingMonitor
from tests.virtual_clock import VirtualClock

PICTURE = np.zeros((2, 2, 3), np.uint8)
GOOD = FramingItem(FramingState.GOOD)


class Watched:
    """A monitor in virtual time, with a source of thirty frames a second. Its thread runs only as the test says."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock = VirtualClock()
        self.started, self.opened, self.judged = 0, 0, 0
        self.error: Exception | None = None
        self.fault: Exception | None = None
        monkeypatch.setattr(threading.Thread, "start", self._start)
        self.events = EventHub()
        self.monitor = FramingMonitor(self.events, self._open, self._judge, self.clock)
        self.index = 0
        self.clock.every(1 / 30, self._film)

    def _start(self) -> None:
        self.started += 1

    def _film(self) -> None:
        self.monitor.offer(Frame(PICTURE, self.index, self.clock.now(), self.index / 30))
        self.index += 1

    def _open(self) -> FaceDetector:
        self.opened += 1
        if self.error is not None:
            raise self.error
        return cast(FaceDetector, object())

    def _judge(self, image: DisplayImage, detector: FaceDetector) -> Framing:
        self.judged += 1
        if self.fault is not None:
            raise self.fault
        return Framing(FaceCount.ONE, "", GOOD, GOOD, GOOD, GOOD, GOOD, None)


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Watched:
    return Watched(monkeypatch)


def test_nothing_is_done_while_nobody_wants_it(watched: Watched) -> None:
    watched.clock.sleep(60.0)
    assert (watched.started, watched.opened, watched.judged) == (0, 0, 0)


def test_it_is_told_some_times_a_second_for_ten_seconds(watched: Watched) -> None:
    with watched.events.listen() as heard:
        watched.monitor.want(True)
        watched.monitor.run()
        told = heard.qsize()
        assert heard.get().data["distance"] == {"state": "good", "advice": ""}
    assert told == watched.judged == pytest.approx(WANTED_S / PERIOD_S, rel=0.1)
    watched.clock.sleep(60.0)
    assert watched.judged == told
    assert watched.started == 1


def test_whoever_renews_it_gets_it_for_longer_from_the_same_thread(watched: Watched) -> None:
    watched.monitor.want(True)
    for at in (5.0, 10.0, 15.0):
        watched.clock.at(at, lambda: watched.monitor.want(True))
    began = watched.clock.now()
    watched.monitor.run()
    assert watched.clock.now() - began == pytest.approx(15.0 + WANTED_S, abs=0.5)
    assert (watched.started, watched.opened) == (1, 1)


def test_it_ends_when_it_is_no_longer_wanted_and_begins_anew(watched: Watched) -> None:
    watched.monitor.want(True)
    watched.clock.at(2.0, lambda: watched.monitor.want(False))
    began = watched.clock.now()
    watched.monitor.run()
    assert watched.clock.now() - began == pytest.approx(2.0, abs=0.5)
    watched.monitor.want(True)
    assert watched.started == 2


def test_a_question_is_answered_with_a_frame_of_now(watched: Watched) -> None:
    watched.clock.at(0.1, watched.monitor.run)  # what the thread does
    assert watched.monitor.framing().face is FaceCount.ONE
    assert watched.started == 1


def test_without_frames_it_says_so(watched: Watched) -> None:
    began = watched.clock.now()
    with pytest.raises(NotReadyError, match="no frames come"):
        watched.monitor.framing()
    assert watched.clock.now() - began <= ANSWER_S + 0.1


def test_missing_models_are_told_with_their_cure_and_tried_again(watched: Watched) -> None:
    watched.error = ModelError("model x is not pulled", "run `relit models pull x`")
    watched.clock.at(0.1, watched.monitor.run)
    began = watched.clock.now()
    with pytest.raises(NotReadyError, match="model x is not pulled; run `relit models pull x`"):
        watched.monitor.framing()
    assert watched.clock.now() - began == pytest.approx(0.1, abs=0.05)  # at once, not when time is up
    watched.error = None
    watched.clock.at(0.1, watched.monitor.run)
    assert watched.monitor.framing().face is FaceCount.ONE


def test_a_fault_ends_it_and_the_next_question_begins_anew(watched: Watched) -> None:
    watched.fault = ZeroDivisionError("a bug")
    watched.clock.at(0.1, watched.monitor.run)
    with pytest.raises(NotReadyError, match="cannot be judged; please report it"):
        watched.monitor.framing()
    watched.fault = None
    watched.monitor.want(True)
    assert watched.started == 2


def test_closing_ends_it(watched: Watched) -> None:
    watched.monitor.want(True)
    watched.clock.at(1.0, watched.monitor.close)
    began = watched.clock.now()
    watched.monitor.run()
    assert watched.clock.now() - began < 2.0
    watched.monitor.want(True)
    assert watched.started == 1
