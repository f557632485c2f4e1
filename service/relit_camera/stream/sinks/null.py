"""A sink that shows nothing: for measuring, and for running with the preview alone."""

from __future__ import annotations

from relit_camera.space.images import DisplayImage
from relit_camera.stream.sinks.base import SinkInfo


class NullSink:
    """Counts pictures and keeps the last.

    Attributes:
        count: pictures written.
        last: the newest, or None.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._info = SinkInfo("null", "", size)
        self.count = 0
        self.last: DisplayImage | None = None

    def write(self, image: DisplayImage) -> None:
        """Count a picture."""
        self.last = image
        self.count += 1

    def describe(self) -> SinkInfo:
        """Say what the sink is."""
        return self._info

    def close(self) -> None:
        """Do nothing."""
