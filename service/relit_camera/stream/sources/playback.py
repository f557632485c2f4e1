"""A source whose pictures and times are known: a file, a still, a pattern."""

from __future__ import annotations

import time
from collections.abc import Iterator

from relit_camera.space.images import DisplayImage, Frame
from relit_camera.stream.sources.base import SourceInfo
from relit_camera.stream.sources.threaded import ThreadedSource

Timed = tuple[DisplayImage, float]
"""A picture and its time in seconds from the first one."""

LATE_S = 0.5


class Playback(ThreadedSource):
    """Gives each picture when it is due, counted from the first `read`; drops those that nobody came for."""

    def __init__(self, info: SourceInfo, pictures: Iterator[Timed]) -> None:
        """Set up; no picture is asked for before the first `read`.

        Args:
            info: what `describe` answers.
            pictures: their times grow. The source ends after the last.
        """
        super().__init__(info)
        self._pictures = enumerate(pictures)

    def _produce(self) -> None:
        start = time.monotonic()
        for index, (image, time_s) in self._pictures:
            late_s = time.monotonic() - (start + time_s)
            if late_s > LATE_S:  # suspended, or decoding is too slow: go on from here instead of rushing through
                start += late_s
            elif self._stopping.wait(max(0.0, -late_s)):
                return
            if self._stopping.is_set():
                return
            self._publish(Frame(image, index, time.monotonic(), time_s))
