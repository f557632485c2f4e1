"""A picture file as source: the same picture again and again."""

from __future__ import annotations

import itertools
from pathlib import Path

from relit_camera.space.picture_files import read_display
from relit_camera.stream.sources.base import Source, SourceInfo
from relit_camera.stream.sources.playback import Playback


def still_source(path: Path, fps: float) -> Source:
    """Show a picture file `fps` times a second, for ever.

    Raises:
        ImageError: the file is missing or is no picture.
    """
    image = read_display(path)
    image.setflags(write=False)
    described = SourceInfo("still", str(path), (image.shape[1], image.shape[0]), fps)
    return Playback(described, ((image, number / fps) for number in itertools.count()))
