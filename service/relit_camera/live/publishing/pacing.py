"""When the next picture is due: steady deadlines that settle just after the pictures."""

from __future__ import annotations


class Pacer:
    """Deadlines at a frame rate, computed from one monotonic clock, so that they do not drift.

    A picture that is ready waits for the next deadline, up to a whole period. When pictures come at about the frame
    rate, each deadline is moved by at most `NUDGE` of a period, until pictures are ready `MARGIN` of a period before
    it: latency falls, and the time between frames stays even. Pictures at any other rate come at all phases, and the
    moves cancel out.

    Attributes:
        MARGIN: how long before its deadline a picture should be ready, as a share of a period.
        NUDGE: the most that one deadline is moved, as a share of a period.
        LATE: periods behind a deadline after which the deadlines start anew.
        period: seconds between two deadlines.
        deadline: time of the next tick, in seconds.
    """

    MARGIN = 0.1
    NUDGE = 0.01
    LATE = 3.0

    def __init__(self, fps: float, now: float) -> None:
        self.period = 1.0 / fps
        self.deadline = now

    def advance(self, now: float, waited_s: float | None = None) -> None:
        """Set the next deadline. More than `LATE` periods behind, start anew at `now` instead of catching up.

        Args:
            now: time in seconds.
            waited_s: how long the picture just shown had been ready before it was shown; None if none was new.
        """
        self.deadline += self.period
        if waited_s is not None:
            half = self.period / 2
            ahead = (waited_s - self.MARGIN * self.period + half) % self.period - half
            limit = self.NUDGE * self.period
            self.deadline -= min(max(ahead, -limit), limit)
        if now - self.deadline > self.LATE * self.period:
            self.deadline = now + self.period
