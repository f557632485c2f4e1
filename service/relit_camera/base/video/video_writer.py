"""Writes video files with FFmpeg's libraries (PyAV), whole or not at all."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any, Self

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, VideoReformatter

from relit_camera.base.errors import ImageError, StorageError, VideoError
from relit_camera.base.images.image_types import DisplayImage, check_image
from relit_camera.base.storage.atomic_files import atomic_path, storage_error
from relit_camera.base.video.video_decoding import ACCURATE_INTERPOLATION, BT709, MAX_SIDE, MIN_SIDE

VIDEO_SUFFIXES = frozenset({".mp4", ".mkv", ".mov"})

TICKS_PER_S = 10_000
"""Time stamps are written in steps of this or finer."""


class VideoWriter:
    """Writes H.264 in 4:2:0, tagged and converted as BT.709 (limited range), to MP4, MOV or MKV. Whole or not at all.

    Use it as a context manager, or call `close`. When the body raises, when writing fails, or when no frame was
    written, nothing is left. Both sides of a 4:2:0 picture are even: an odd width or height gains a copy of the last
    column or row.
    """

    def __init__(self, path: Path, size: tuple[int, int], fps: float, *, crf: int = 18, threads: int = 1) -> None:
        """Open a file for writing.

        Args:
            path: .mp4, .mkv or .mov.
            size: width and height in pixels of the pictures that will come.
            fps: nominal frames a second; kept as a fraction, so that 29.97 is 30000/1001.
            crf: x264's constant rate factor: 0 is lossless, 18 hard to tell from the original, 51 worst.
            threads: of the encoder.

        Raises:
            VideoError: another suffix, or an absurd size.
            StorageError: the file cannot be written.
        """
        self.path = Path(path)
        if self.path.suffix.lower() not in VIDEO_SUFFIXES:
            known = ", ".join(sorted(VIDEO_SUFFIXES))
            raise VideoError(f"cannot write a video as '{self.path.name}'", f"name it with one of {known}")
        if not all(MIN_SIDE <= side <= MAX_SIDE for side in size):
            raise VideoError(f"cannot write a video of {size[0]}x{size[1]}", f"use sides of {MIN_SIDE} to {MAX_SIDE}")
        self.size = size
        self.frames = 0
        rate = rational_rate(fps)
        subdivision = -(-TICKS_PER_S // rate.numerator)
        self._time_base = Fraction(1, rate.numerator * subdivision)
        self._interval = rate.denominator * subdivision
        self._last_pts = -self._interval
        self._open = True
        self._reformatter = VideoReformatter()
        with ExitStack() as files:  # closed in turn: the container first, then the file takes its name
            temporary = files.enter_context(atomic_path(self.path))
            self._container = files.enter_context(av.open(str(temporary.absolute()), "w"))
            self._stream = self._add_stream(rate, crf, threads)
            self._files = files.pop_all()

    def write(self, image: DisplayImage, time_s: float | None = None) -> None:
        """Add a picture, uint8 sRGB RGB (height, width, 3), at `time_s`, or one interval after the last.

        Raises:
            ImageError: the picture has another size than was announced.
            StorageError: the file cannot be written; it is gone then.
        """
        if not self._open:
            raise StorageError(f"cannot write to {self.path}: it is closed, or was given up after a failure")
        check_image(image, np.uint8, "picture to write")
        height, width = image.shape[:2]
        if (width, height) != self.size:
            raise ImageError(f"picture is {width}x{height}, the video {self.size[0]}x{self.size[1]}")
        if width % 2 or height % 2:
            image = cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
        picture = self._reformatter.reformat(
            av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24"),
            format="yuv420p",
            dst_colorspace=BT709,
            dst_color_range=ColorRange.MPEG,
            interpolation=ACCURATE_INTERPOLATION,
        )
        picture.colorspace, picture.color_range = BT709, ColorRange.MPEG.value
        due = self._last_pts + self._interval
        self._last_pts = due if time_s is None else max(round(time_s / self._time_base), self._last_pts + 1)
        picture.pts, picture.time_base = self._last_pts, self._time_base
        self._encode(picture)
        self.frames += 1

    def close(self) -> None:
        """Finish the file. Harmless when repeated.

        Raises:
            StorageError: the end cannot be written; the file is gone then.
        """
        if not self._open:
            return
        if self.frames == 0:
            self._give_up(VideoError("no frame was written"))
            return
        self._encode(None)
        self._open = False
        try:
            self._files.close()
        except OSError as error:
            raise storage_error(self.path, error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        if error is None:
            self.close()
        elif self._open:
            self._give_up(error)

    def _add_stream(self, rate: Fraction, crf: int, threads: int) -> Any:
        options = {"crf": str(crf), "preset": "veryfast"}
        stream = self._container.add_stream("libx264", rate=rate, options=options)
        stream.width, stream.height = (side + side % 2 for side in self.size)
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.time_base = self._time_base
        context.thread_count = threads
        context.color_primaries = context.color_trc = context.colorspace = BT709
        context.color_range = ColorRange.MPEG.value
        return stream

    def _encode(self, picture: Any) -> None:
        try:
            for packet in self._stream.encode(picture):
                self._container.mux(packet)
        except OSError as error:
            with suppress(OSError):  # the first failure is the one to report
                self._give_up(error)
            raise storage_error(self.path, error) from error
        except BaseException as error:
            self._give_up(error)
            raise

    def _give_up(self, error: BaseException) -> None:
        """Delete what was written; a full disk and similar errors are raised as StorageError."""
        self._open = False
        self._files.__exit__(type(error), error, error.__traceback__)


def rational_rate(fps: float) -> Fraction:
    """Give the frame rate as a fraction that containers keep exactly: 29.97 is 30000/1001, 12.5 is 25/2."""
    ntsc = Fraction(round(fps * 1.001) * 1000, 1001)
    if ntsc and abs(float(ntsc) - fps) < 0.002 and fps != round(fps):
        return ntsc
    return Fraction(fps).limit_denominator(1001)
