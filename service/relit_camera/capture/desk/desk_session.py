"""The session of a desk capture: which pattern is to be shown, and which frames count. No threads, no devices.

The page says which step its screen shows; frames count only after the screen and the webcam have settled. Which
pattern a frame really shows is told in the pictures later on (`capture.desk.patterns`), so that a late screen does no
harm. The session ends where the page is no longer heard of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from relit_camera.base.concurrency.clock import Clock
from relit_camera.base.errors import CaptureError
from relit_camera.capture.desk.patterns.pattern_sequence import Pattern


@dataclass(frozen=True)
class SessionTimings:
    """Times of a session, in seconds.

    Attributes:
        frames_a_step: frames that are kept of each pattern.
        settling_s: after the page has said that it shows a pattern; it includes the fade.
        min_step_s: least time of a step: at most three changes a second, as guidelines for photosensitive people ask
            (WCAG 2.2, 2.3.1).
        page_timeout_s: without a word from the page, after which it counts as closed.
        show_timeout_s: until the page shows a pattern, after which the screen counts as stuck.
        step_timeout_s: for the frames of a pattern that is shown, after which the webcam counts as stuck.
    """

    frames_a_step: int = 10
    settling_s: float = 0.25
    min_step_s: float = 0.34
    page_timeout_s: float = 2.5
    show_timeout_s: float = 12.0
    step_timeout_s: float = 12.0


class DeskSession:
    """One pass through the patterns. Not thread-safe."""

    def __init__(self, patterns: Sequence[Pattern], clock: Clock, timings: SessionTimings | None = None) -> None:
        """Begin with the first pattern.

        Args:
            patterns: in the order in which they are shown.
            clock: by which all is timed.
            timings: of the steps.
        """
        self._patterns, self._clock, self._timings = patterns, clock, timings or SessionTimings()
        self._step = 0
        self._heard_at = clock.now()
        self._began_at = self._heard_at
        self._shown_at: float | None = None
        self._taken = 0

    @property
    def step(self) -> int:
        """Index of the pattern that is to be shown; their number at the end."""
        return self._step

    @property
    def is_done(self) -> bool:
        """Whether all patterns were filmed."""
        return self._step == len(self._patterns)

    def page_shows(self, step: int) -> None:
        """Note that the page is there, and which step it shows; called several times a second."""
        self._heard_at = self._clock.now()
        if step == self._step and self._shown_at is None:
            self._shown_at = self._heard_at

    def require_alive(self) -> None:
        """Check that page and webcam still answer.

        Raises:
            CaptureError: the page was closed or hidden, or a step takes too long.
        """
        now = self._clock.now()
        if now - self._heard_at > self._timings.page_timeout_s:
            what = f"the page with the patterns was closed or hidden at step {self._step + 1} of {len(self._patterns)}"
            raise CaptureError(what, "start again, and keep it in front, full screen, until it is done")
        if self._shown_at is None:
            late, since, at_most = "the page does not show its pattern", self._began_at, self._timings.show_timeout_s
        else:
            late, since, at_most = "the webcam gives no frames", self._shown_at, self._timings.step_timeout_s
        if now - since > at_most:
            raise CaptureError(f"{late}: step {self._step + 1} took too long", "close other programs, and start again")

    def wants_frame(self, captured_at: float) -> bool:
        """Whether a frame that was captured at a time of the clock counts for the pattern that is shown."""
        if self.is_done or self._shown_at is None or self._taken >= self._timings.frames_a_step:
            return False
        return captured_at >= self._shown_at + self._timings.settling_s

    def frame_taken(self) -> None:
        """Note that a frame was kept."""
        self._taken += 1

    def advance(self) -> None:
        """Go to the next step where this one is finished."""
        enough = self._taken >= self._timings.frames_a_step
        if not self.is_done and enough and self._clock.now() >= self._began_at + self._timings.min_step_s:
            self._step += 1
            self._began_at, self._shown_at, self._taken = self._clock.now(), None, 0
