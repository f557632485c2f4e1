"""What every sink is.

A sink that shows nothing: for measuring, and for running with the preview alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from relit_camera.base.images.image_types import DisplayImage


@dataclass(frozen=True)
class SinkInfo:
    """What a sink is.

    Attributes:
        kind: camera, file or null.
        id: device node, path, or empty.
        size: width and height in pixels that it takes, fixed for its life.
    """

    kind: str
    id: str
    size: tuple[int, int]


class Sink(Protocol):
    """Takes pictures from one thread, all of one size.

    After a failure it may be written to again: a camera tries anew. A file that failed is lost, and the sink says so at
    each call, to the end.
    """

    def write(self, image: DisplayImage) -> None:
        """Show or keep a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: the virtual camera is gone or in use.
            StorageError: the file cannot be written.
            ImageError: the picture has another size.
        """
        ...

    def describe(self) -> SinkInfo:
        """Say what the sink is."""
        ...

    def close(self) -> None:
        """Finish. Harmless when repeated.

        Raises:
            StorageError: the end of the file cannot be written, or the file was lost before.
        """
        ...


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
