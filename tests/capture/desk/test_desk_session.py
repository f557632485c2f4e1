"""The session of a desk capture in virtual time: what counts, what waits, and what ends it."""

from __future__ import annotations

import itertools
import threading
from dataclasses import replace

import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.desk.desk_session import DeskSession, SessionTimings
from relit_camera.capture.desk.patterns.pattern_sequence import Pattern, standard_sequence
from tests.virtual_clock import VirtualClock

TIMINGS = SessionTimings()
PATTERNS: list[Pattern] = ["black", "white", [1.0, 0.0], "black"]
FRAME_S = 1 / 30


class Filming:
    """A page that shows each step a little late, and a webcam of 30 frames a second."""

    def __init__(
        self, patterns: list[Pattern], page_delay_s: float = 0.08, timings: SessionTimings | None = None
    ) -> None:
        self.clock = VirtualClock()
        self.session = DeskSession(patterns, self.clock, timings)
        self.page_open, self.webcam_on = True, True
        self.shown = -1
        self.changes: list[float] = []
        self.frames: list[tuple[int, float]] = []
        self._delay_s = page_delay_s
        self.clock.every(0.1, self._page)
        self.clock.every(FRAME_S, self._webcam)

    def _page(self) -> None:
        if not self.page_open:
            return
        step = self.session.step
        self.session.page_shows(self.shown)
        if step != self.shown:
            self.clock.at(self._delay_s, lambda: self._show(step))

    def _show(self, step: int) -> None:
        if self.shown != step:
            self.shown = step
            self.changes.append(self.clock.now())

    def _webcam(self) -> None:
        if self.webcam_on and self.session.wants_frame(self.clock.now()):
            self.frames.append((self.session.step, self.clock.now()))
            self.session.frame_taken()

    def run(self, limit_s: float = 120.0) -> None:
        ends = self.clock.now() + limit_s
        while not self.session.is_done and self.clock.now() < ends:
            self.clock.wait(threading.Event(), 0.02)
            self.session.require_alive()
            self.session.advance()


def test_each_pattern_gets_its_frames_and_all_take_less_than_half_a_minute() -> None:
    filming = Filming(standard_sequence(5, 3))
    began = filming.clock.now()
    filming.run()
    assert filming.session.is_done
    steps = [step for step, _ in filming.frames]
    assert steps == sorted(steps)
    assert all(steps.count(step) == TIMINGS.frames_a_step for step in range(24))
    assert filming.clock.now() - began < 30


def test_the_screen_changes_three_times_a_second_at_most_whatever_the_webcam_does() -> None:
    filming = Filming(standard_sequence(5, 3), page_delay_s=0.0)
    fast = DeskSession(PATTERNS, filming.clock, SessionTimings(frames_a_step=1, settling_s=0.0))
    changes = []
    while not fast.is_done:
        fast.page_shows(fast.step)
        if fast.wants_frame(filming.clock.now()):
            fast.frame_taken()
        before = fast.step
        fast.advance()
        if fast.step != before:
            changes.append(filming.clock.now())
        filming.clock.sleep(0.01)
    assert min(later - earlier for earlier, later in itertools.pairwise(changes)) > 1 / 3
    filming.run()
    assert min(b - a for a, b in zip(filming.changes, filming.changes[1:], strict=False)) > 1 / 3


def test_frames_count_only_after_the_screen_has_settled() -> None:
    filming = Filming(PATTERNS, page_delay_s=0.5)
    filming.run()
    for change, step in zip(filming.changes, range(4), strict=True):
        first = min(at for seen, at in filming.frames if seen == step)
        assert first >= change + TIMINGS.settling_s


def test_a_step_that_is_not_shown_yet_is_not_filmed() -> None:
    clock = VirtualClock()
    session = DeskSession(PATTERNS, clock)
    session.page_shows(3)
    clock.sleep(1)
    assert not session.wants_frame(clock.now())
    session.page_shows(0)
    clock.sleep(1)
    assert session.wants_frame(clock.now())


def test_a_frame_from_before_the_change_does_not_count_however_late_it_is_looked_at() -> None:
    clock = VirtualClock()
    session = DeskSession(PATTERNS, clock)
    captured_at = clock.now()
    session.page_shows(0)
    clock.sleep(1)
    assert not session.wants_frame(captured_at)
    assert session.wants_frame(captured_at + TIMINGS.settling_s)


def test_a_page_that_is_closed_midway_ends_it() -> None:
    filming = Filming(standard_sequence(5, 3))
    filming.clock.at(5.0, lambda: setattr(filming, "page_open", False))
    began = filming.clock.now()
    with pytest.raises(CaptureError, match="page with the patterns was closed"):
        filming.run()
    assert filming.clock.now() - began < 5 + TIMINGS.page_timeout_s + 0.2


def test_a_webcam_that_stops_ends_it() -> None:
    filming = Filming(standard_sequence(5, 3))
    filming.clock.at(5.0, lambda: setattr(filming, "webcam_on", False))
    with pytest.raises(CaptureError, match="the webcam gives no frames"):
        filming.run()


@pytest.mark.parametrize("page_delay_s", [TIMINGS.show_timeout_s - 1, TIMINGS.show_timeout_s + 1])
def test_a_page_that_does_not_show_its_pattern_is_told_in_time_and_a_late_one_is_filmed(page_delay_s: float) -> None:
    """The webcam has all of its own time once a pattern is shown, however late that was."""
    timings = replace(TIMINGS, step_timeout_s=3.0)
    filming = Filming(["white"], page_delay_s, timings)
    late = page_delay_s > TIMINGS.show_timeout_s
    began = filming.clock.now()
    if late:
        with pytest.raises(CaptureError, match="does not show its pattern"):
            filming.run()
        assert filming.clock.now() - began == pytest.approx(TIMINGS.show_timeout_s, abs=0.2)
    else:
        filming.run()
        assert len(filming.frames) == TIMINGS.frames_a_step
