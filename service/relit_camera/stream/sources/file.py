"""A video file as source."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from relit_camera.stream.sources.base import Source, SourceInfo
from relit_camera.stream.sources.playback import Timed, playback
from relit_camera.stream.video import VideoReader, probe


def file_source(path: Path, *, loop: bool, realtime: bool) -> Source:
    """Play a video file; see `playback` for `loop` and `realtime`.

    Raises:
        VideoError: as `VideoReader`; what shows only later, `read` raises.
    """
    info = probe(path)

    def play() -> Iterator[Timed]:
        with VideoReader(path, accurate=not realtime) as video:
            for frame in video:
                yield frame.image, frame.time_s

    described = SourceInfo("file", str(path), (info.width, info.height), info.fps)
    return playback(described, play, loop=loop, realtime=realtime)
