"""A video file as source."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path

from relit_camera.stream.sources.base import Source, SourceInfo
from relit_camera.stream.sources.playback import Playback, Timed
from relit_camera.video.reader import VideoReader, probe


def file_source(path: Path) -> Source:
    """Play a video file in its own time, for ever.

    Raises:
        VideoError: as `VideoReader`; what shows only later, `read` raises.
    """
    info = probe(path)
    described = SourceInfo("file", str(path), (info.width, info.height), info.fps)
    return Playback(described, _rounds(path, info.fps))


def _rounds(path: Path, fps: float) -> Iterator[Timed]:
    """The pictures of one round after another, their times growing throughout."""
    start = 0.0
    while True:
        with VideoReader(path, accurate=False) as video:
            for frame in video:
                end = start + frame.time_s
                yield frame.image, end
        gc.collect()  # the reader's first picture is in a reference cycle of PyAV's, and a short clip ends often
        start = end + 1 / fps
