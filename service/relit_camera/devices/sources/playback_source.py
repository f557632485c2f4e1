"""Sources that play pictures at given times: video files, picture files and (`pattern_source`) the test pattern."""

from __future__ import annotations

import gc
import itertools
import time
from collections.abc import Iterator
from pathlib import Path

from relit_camera.base.images.image_files import read_display
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.devices.sources.source import Source, SourceInfo, ThreadedSource

TimedImage = tuple[DisplayImage, float]
"""A picture and its time in seconds from the first one."""

MAX_LATENESS_S = 0.5
"""A source that is later than this (the machine was suspended, or decoding is too slow) continues from now on, instead
of playing faster to catch up."""


class PlaybackSource(ThreadedSource):
    """Plays pictures, each at its time after the first `read`; pictures that were not read in time are dropped."""

    def __init__(self, info: SourceInfo, pictures: Iterator[TimedImage]) -> None:
        """Set up; no picture is taken before the first `read`.

        Args:
            info: facts about the source, for `describe`.
            pictures: pictures with growing times. The source ends after the last.
        """
        super().__init__(info)
        self._pictures = enumerate(pictures)

    def _produce(self) -> None:
        start = time.monotonic()
        for index, (image, time_s) in self._pictures:
            late_s = time.monotonic() - (start + time_s)
            if late_s > MAX_LATENESS_S:
                start += late_s
            elif self._stopping.wait(max(0.0, -late_s)):
                return
            if self._stopping.is_set():
                return
            self._publish(Frame(image, index, time.monotonic(), time_s))


def image_source(path: Path, fps: float) -> Source:
    """A source that gives the picture of a file `fps` times a second, for ever.

    Raises:
        ImageError: the file is missing or is no picture.
    """
    image = read_display(path)
    image.setflags(write=False)
    described = SourceInfo("still", str(path), (image.shape[1], image.shape[0]), fps)
    return PlaybackSource(described, ((image, number / fps) for number in itertools.count()))


def file_source(path: Path) -> Source:
    """A source that plays a video file at its own speed, again and again.

    Raises:
        VideoError: as `VideoReader`; damage that is found later is raised by `read`.
    """
    # FFmpeg is loaded only where it is needed: it takes a fifth of a second, and 15 MB.
    from relit_camera.base.video.video_readers import probe_video

    info = probe_video(path)
    described = SourceInfo("file", str(path), (info.width, info.height), info.fps)
    return PlaybackSource(described, _loop_frames(path, info.fps))


def _loop_frames(path: Path, fps: float) -> Iterator[TimedImage]:
    """The pictures of the file, again and again, with times that grow throughout."""
    from relit_camera.base.video.video_readers import VideoReader

    start = 0.0
    while True:
        with VideoReader(path, accurate=False) as video:
            for frame in video:
                end = start + frame.time_s
                yield frame.image, end
        gc.collect()  # PyAV keeps the reader's first picture in a reference cycle, and short clips end often
        start = end + 1 / fps
