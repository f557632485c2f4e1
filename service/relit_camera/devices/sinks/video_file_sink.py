"""A video file as sink."""

from __future__ import annotations

import time
from pathlib import Path

from relit_camera.base.errors import StorageError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.devices.sinks.sink import SinkInfo


class VideoFileSink:
    """Writes what is published, each picture at the time when it was. The file takes its name when it is closed.

    Where writing fails (a full disk) nothing is left of the file, and it is not begun anew: a recording whose beginning
    is missing would look whole. The failure is told again by every `write` and by `close`, so that the command that
    recorded cannot end as if all were well.
    """

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        """Open the file.

        Raises:
            VideoError: no suffix of a video.
            StorageError: the file cannot be written.
        """
        self._video = VideoWriter(path, size, fps)
        self._info = SinkInfo("file", str(path), size)
        self._started_at: float | None = None
        self._lost: tuple[str, str] | None = None  # what and cure; the error itself would keep a picture in memory

    def write(self, image: DisplayImage) -> None:
        """Add a picture at the present moment.

        Raises:
            StorageError: the file cannot be written, or could not before; it is gone then.
            ImageError: the picture has another size.
        """
        self._check()
        now = time.monotonic()
        if self._started_at is None:
            self._started_at = now
        try:
            self._video.write(image, now - self._started_at)
        except StorageError as error:
            self._lost = error.what, error.cure
            raise

    def describe(self) -> SinkInfo:
        """Say what the sink is."""
        return self._info

    def close(self) -> None:
        """Finish the file.

        Raises:
            StorageError: its end cannot be written, or the file was lost before.
        """
        self._check()
        self._video.close()

    def _check(self) -> None:
        if self._lost is not None:
            raise StorageError(*self._lost)
