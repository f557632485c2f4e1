"""The brightness of every frame of a video, cell by cell: all that is kept of it for finding the flashes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import VideoError
from relit_camera.space.colour import Gamma, luminance, uint8_from_linear
from relit_camera.space.images import DisplayImage, LinearImage
from relit_camera.video.linear import LinearReader

CELLS = 32
"""Cells along the longer side."""
_PIXELS_A_CELL = 8
"""Frames are decoded so small that a cell has so many pixels a side: 4K costs little more than its decoding."""

MIN_FRAMES = 8


@dataclass(frozen=True, eq=False)
class Brightness:
    """How bright each cell of a grid over the upright picture is, frame by frame.

    Attributes:
        cells: (frames, rows, columns) float32 mean luminance, linear; the video's white is 1.
        times_s: (frames,) float64 presentation times, growing.
        size: width and height of the video's upright pictures in pixels.
        still: small uint8 sRGB picture in which each pixel is as bright as it ever was: where the face is, it shows.
    """

    cells: NDArray[np.float32]
    times_s: NDArray[np.float64]
    size: tuple[int, int]
    still: DisplayImage

    @property
    def interval_s(self) -> float:
        """The usual time from frame to frame."""
        return float(np.median(np.diff(self.times_s)))


def watch(
    path: Path, gamma: Gamma = "srgb", *, threads: int = 1, progress: Callable[[int], None] = lambda watched: None
) -> Brightness:
    """Watch a whole video once, small. Memory: 4 KB a frame.

    Args:
        path: the video.
        gamma: its curve.
        threads: of the decoder.
        progress: called with the number of frames watched.

    Raises:
        VideoError: as `video.linear.LinearReader`, or it has fewer than eight frames.
    """
    cells, times_s = [], []
    brightest: LinearImage | None = None
    with LinearReader(path, gamma, longer_side=CELLS * _PIXELS_A_CELL, threads=threads) as video:
        for frame in video:
            brightest = frame.image if brightest is None else np.maximum(brightest, frame.image)
            cells.append(cells_of(luminance(frame.image)))
            times_s.append(frame.time_s)
            progress(len(times_s))
        size = (video.info.width, video.info.height)
    if brightest is None or len(times_s) < MIN_FRAMES:
        raise VideoError(f"{path} has {len(times_s)} frames only", "record at least ten seconds")
    return Brightness(np.stack(cells), np.array(times_s), size, uint8_from_linear(brightest))


def cells_of(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means (rows, columns) of a picture (height, width) over a grid with `CELLS` cells along its longer side."""
    height, width = picture.shape
    scale = CELLS / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)
