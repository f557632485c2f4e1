"""Recording some frames of the running camera, for a capture that is asked for while it runs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.images.image_types import Frame
from relit_camera.base.images.resize import shrink

ASK_INTERVAL_S = 0.2


class FrameRecorder:
    """Hands frames of the camera to one other thread while that records; costs nothing otherwise. Thread-safe."""

    def __init__(self, clock: Clock = SYSTEM_CLOCK) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._frames: list[Frame] = []
        self._wanted = 0
        self._interval_s = 0.0
        self._longest_side_px: int | None = None

    def offer(self, frame: Frame) -> None:
        """Take a frame if one is wanted now; called by the camera with each frame."""
        if not self._wanted:
            return
        with self._changed:
            due = not self._frames or frame.captured_at >= self._frames[-1].captured_at + self._interval_s
            if due and len(self._frames) < self._wanted:
                scale = (self._longest_side_px or max(frame.size)) / max(frame.size)
                self._frames.append(replace(frame, image=shrink(frame.image, scale)))
                self._changed.notify_all()

    def record(
        self,
        count: int,
        interval_s: float,
        timeout_s: float,
        go_on: Callable[[], bool] = lambda: True,
        longest_side_px: int | None = None,
    ) -> list[Frame]:
        """The next `count` frames, `interval_s` seconds or more apart; fewer where it ends before.

        One recording at a time: a second thread must not call this meanwhile.

        Args:
            count: how many.
            interval_s: least time between two of them.
            timeout_s: when it ends at the latest.
            go_on: asked every `ASK_INTERVAL_S`; it ends when this says no.
            longest_side_px: larger frames are reduced to it at once; None keeps them as they are.
        """
        ends_at = self._clock.now() + timeout_s
        with self._changed:
            self._frames, self._interval_s, self._longest_side_px = [], interval_s, longest_side_px
            self._wanted = count
            try:
                while len(self._frames) < count and go_on() and (left := ends_at - self._clock.now()) > 0:
                    self._clock.wait_for(self._changed, lambda: len(self._frames) >= count, min(left, ASK_INTERVAL_S))
                return self._frames
            finally:
                self._frames, self._wanted = [], 0
