"""A video file as sink."""

from __future__ import annotations

import time
from pathlib import Path

from relit_camera.base.errors import StorageError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.devices.sinks.sink import SinkInfo


class VideoFileSink:
    """Writes the published pictures to a video file with the times of publication. `close` completes the file.

    If writing fails (the disk is full) the file is deleted and not started again: a recording without its beginning
    would look complete. Every further `write` and `close` raises the failure again, so that the command that records
    cannot end with success.
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
        self._lost: tuple[str, str] | None = None  # what and cure: the error object would keep a picture in memory

    def write(self, image: DisplayImage) -> None:
        """Add a picture at the present time.

        Raises:
            StorageError: the file cannot be written, now or before; it was deleted.
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
        """Facts about the sink."""
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
