"""Numbers the frames of several sources, read one after the other, as if they came from one."""

from __future__ import annotations

from dataclasses import replace

from relit_camera.base.concurrency.clock import Clock
from relit_camera.base.images.image_types import Frame


class FrameNumbering:
    """Lets indices and times of frames go on where a source is closed and another one is read."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._began_at = clock.now()
        self._first = self._next = 0
        self._since_s = 0.0

    def begin_source(self, index: int = 0, time_s: float = 0.0) -> None:
        """Note that another source is read from now on.

        Args:
            index: that its next frame has at least.
            time_s: that its next frame has at least.
        """
        self._first = self._next - index
        self._since_s = self._clock.now() - self._began_at - time_s if self._next else 0.0

    def renumber(self, frame: Frame) -> Frame:
        """A frame of the present source, with the index and time that it has among all frames."""
        self._next = self._first + frame.index + 1
        if not self._first and not self._since_s:
            return frame
        return replace(frame, index=self._first + frame.index, time_s=self._since_s + frame.time_s)
