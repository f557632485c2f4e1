"""A picture file as source: the same picture again and again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from relit_camera.space.picture_files import read_display
from relit_camera.stream.sources.base import Source, SourceInfo
from relit_camera.stream.sources.playback import Timed, playback


def still_source(path: Path, fps: float, *, loop: bool, realtime: bool) -> Source:
    """Show a picture file `fps` times a second for ever, or once where neither `loop` nor `realtime` is wanted.

    Raises:
        ImageError: the file is missing or is no picture.
    """
    image = read_display(path)
    image.setflags(write=False)

    def play() -> Iterator[Timed]:
        yield image, 0.0

    described = SourceInfo("still", str(path), (image.shape[1], image.shape[0]), fps)
    return playback(described, play, loop=loop or realtime, realtime=realtime)
