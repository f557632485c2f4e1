"""A video file as sink."""

from __future__ import annotations

import time
from pathlib import Path

from relit_camera.space.images import DisplayImage
from relit_camera.stream.sinks.base import SinkInfo
from relit_camera.stream.video_writer import VideoWriter


class FileSink:
    """Writes what is published, each picture at the time when it was. The file takes its name when it is closed."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        """Open the file.

        Raises:
            VideoError: no suffix of a video.
            StorageError: the file cannot be written.
        """
        self._video = VideoWriter(path, size, fps)
        self._info = SinkInfo("file", str(path), size)
        self._started_at: float | None = None

    def write(self, image: DisplayImage) -> None:
        """Add a picture at the present moment.

        Raises:
            StorageError: the file cannot be written; it is gone then.
            ImageError: the picture has another size.
        """
        now = time.monotonic()
        if self._started_at is None:
            self._started_at = now
        self._video.write(image, now - self._started_at)

    def describe(self) -> SinkInfo:
        """Say what the sink is."""
        return self._info

    def close(self) -> None:
        """Finish the file.

        Raises:
            StorageError: its end cannot be written.
        """
        self._video.close()
