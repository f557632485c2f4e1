"""Reading video files for people and networks: uint8 sRGB frames."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from relit_camera.space.images import Frame
from relit_camera.video.decoding import CodeConverter
from relit_camera.video.pictures import PictureReader, VideoInfo


def probe(path: Path) -> VideoInfo:
    """Size, rate and length of a video file, from its header and first frame.

    Raises:
        VideoError: as `VideoReader`.
    """
    with VideoReader(path) as video:
        return video.info


class VideoReader(PictureReader[Frame]):
    """The frames of a video file (MP4, MOV, MKV, WebM, GIF, AVI …) in order of presentation, upright. Iterate once.

    Frames are uint8 sRGB RGB, not writable; `time_s` is the presentation time from the first frame and grows strictly,
    also where the rate varies. A rotation or mirroring flag is applied. Colours are converted by the matrix and range
    that the file names; where it names no matrix, BT.709 is taken for HD and BT.601 for less, as players do.

    Raises:
        VideoError: on opening if the file is missing, empty, cut off, no video, HDR, or of an absurd size; while
            iterating if the size changes, or, after all frames that can be read, if there were damaged ones.
    """

    def __init__(self, path: Path, *, accurate: bool = True, threads: int = 1) -> None:
        """Open a file.

        Args:
            path: the file.
            accurate: convert colours to within half a code value; otherwise faster, about one code value too dark.
            threads: of the decoder.
        """
        self._convert = CodeConverter(accurate=accurate)
        super().__init__(path, threads)

    def _make(self, picture: Any, index: int, time_s: float) -> Frame:
        image = np.ascontiguousarray(self._turn.upright(self._convert(picture)))
        image.setflags(write=False)
        return Frame(image, index, time.monotonic(), time_s)
