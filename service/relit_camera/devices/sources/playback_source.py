"""A source whose pictures and times are known: a file, a still, a pattern.

A picture file as source: the same picture again and again.

A video file as source.
"""

from __future__ import annotations

import gc
import itertools
import time
from collections.abc import Iterator
from pathlib import Path

from relit_camera.base.images.image_files import read_display
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.video.video_readers import VideoReader, probe_video
from relit_camera.devices.sources.source import Source, SourceInfo, ThreadedSource

TimedImage = tuple[DisplayImage, float]
"""A picture and its time in seconds from the first one."""

MAX_LATENESS_S = 0.5


class PlaybackSource(ThreadedSource):
    """Gives each picture when it is due, counted from the first `read`; drops those that nobody came for."""

    def __init__(self, info: SourceInfo, pictures: Iterator[TimedImage]) -> None:
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
            if (
                late_s > MAX_LATENESS_S
            ):  # suspended, or decoding is too slow: go on from here instead of rushing through
                start += late_s
            elif self._stopping.wait(max(0.0, -late_s)):
                return
            if self._stopping.is_set():
                return
            self._publish(Frame(image, index, time.monotonic(), time_s))


def image_source(path: Path, fps: float) -> Source:
    """Show a picture file `fps` times a second, for ever.

    Raises:
        ImageError: the file is missing or is no picture.
    """
    image = read_display(path)
    image.setflags(write=False)
    described = SourceInfo("still", str(path), (image.shape[1], image.shape[0]), fps)
    return PlaybackSource(described, ((image, number / fps) for number in itertools.count()))


def file_source(path: Path) -> Source:
    """Play a video file in its own time, for ever.

    Raises:
        VideoError: as `VideoReader`; what shows only later, `read` raises.
    """
    info = probe_video(path)
    described = SourceInfo("file", str(path), (info.width, info.height), info.fps)
    return PlaybackSource(described, _loop_frames(path, info.fps))


def _loop_frames(path: Path, fps: float) -> Iterator[TimedImage]:
    """The pictures of one round after another, their times growing throughout."""
    start = 0.0
    while True:
        with VideoReader(path, accurate=False) as video:
            for frame in video:
                end = start + frame.time_s
                yield frame.image, end
        gc.collect()  # the reader's first picture is in a reference cycle of PyAV's, and a short clip ends often
        start = end + 1 / fps
