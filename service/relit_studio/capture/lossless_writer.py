"""Lossless video files, for captures without the phone's compression."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Self

import av
import numpy as np

from relit_camera.base.images.image_types import DisplayImage, check_image
from relit_camera.base.storage.atomic_files import atomic_path, storage_error
from relit_camera.base.video.video_writer import rational_rate


class LosslessWriter:
    """Writes RGB pictures losslessly as FFV1 in Matroska; a context manager. A failed file is removed."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        """Open `path` (.mkv) for pictures of `size` (width, height).

        Raises:
            StorageError: the file cannot be written.
        """
        self._path = path
        with ExitStack() as files:
            temporary = files.enter_context(atomic_path(path))
            self._container = files.enter_context(av.open(str(temporary), "w"))
            self._stream = self._container.add_stream("ffv1", rate=rational_rate(fps))
            self._stream.width, self._stream.height = size
            self._stream.pix_fmt = "bgr0"
            self._files = files.pop_all()

    def write(self, image: DisplayImage) -> None:
        """Add a picture, uint8 RGB (height, width, 3).

        Raises:
            ImageError: it is none.
            StorageError: the file cannot be written.
        """
        check_image(image, np.uint8, "picture to write")
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        self._mux(frame.reformat(format="bgr0"))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if error is None:
            with self._files:
                self._mux(None)
        else:
            self._files.__exit__(kind, error, None)

    def _mux(self, frame: av.VideoFrame | None) -> None:
        try:
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except OSError as error:
            raise storage_error(self._path, error) from error
