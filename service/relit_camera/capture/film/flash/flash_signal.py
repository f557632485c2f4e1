"""The brightness of every frame of a video, cell by cell: all that is kept of it for finding the flashes.

One curve from a grid of brightness: what the flash reaches, made good for what the camera's automatics did.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import VideoError
from relit_camera.base.images.color import Gamma, luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_camera.base.video.video_readers import LinearVideoReader
from relit_camera.capture.film.face_circle import FaceCircle

GRID_CELLS = 32
"""Cells along the longer side."""
_PIXELS_A_CELL = 8
"""Frames are decoded so small that a cell has so many pixels a side: 4K costs little more than its decoding."""

MIN_FRAMES = 8


@dataclass(frozen=True, eq=False)
class BrightnessGrid:
    """How bright each cell of a grid over the upright picture is, frame by frame.

    Attributes:
        cells: (frames, rows, columns) float32 mean luminance, linear; the video's white is 1.
        times_s: (frames,) float64 presentation times, growing.
        size: width and height of the video's upright pictures in pixels.
        brightest_picture: small uint8 sRGB picture in which each pixel is as bright as it ever was: where the face is,
            it shows.
    """

    cells: NDArray[np.float32]
    times_s: NDArray[np.float64]
    size: tuple[int, int]
    brightest_picture: DisplayImage

    @property
    def interval_s(self) -> float:
        """The usual time from frame to frame."""
        return float(np.median(np.diff(self.times_s)))


def measure_brightness(
    path: Path, gamma: Gamma = "srgb", *, threads: int = 1, progress: Callable[[int], None] = lambda watched: None
) -> BrightnessGrid:
    """Watch a whole video once, small. Memory: 4 KB a frame.

    Args:
        path: the video.
        gamma: its curve.
        threads: of the decoder.
        progress: called with the number of frames watched.

    Raises:
        VideoError: as `base.video.video_readers.LinearVideoReader`, or it has fewer than eight frames.
    """
    cells, times_s = [], []
    brightest: LinearImage | None = None
    with LinearVideoReader(path, gamma, longer_side=GRID_CELLS * _PIXELS_A_CELL, threads=threads) as video:
        for frame in video:
            brightest = frame.image if brightest is None else np.maximum(brightest, frame.image)
            cells.append(cell_means(luminance(frame.image)))
            times_s.append(frame.time_s)
            progress(len(times_s))
        size = (video.info.width, video.info.height)
    if brightest is None or len(times_s) < MIN_FRAMES:
        raise VideoError(f"{path} has {len(times_s)} frames only", "record at least ten seconds")
    return BrightnessGrid(np.stack(cells), np.array(times_s), size, uint8_from_linear(brightest))


def cell_means(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means (rows, columns) of a picture (height, width) over a grid with `GRID_CELLS` cells along its longer side."""
    height, width = picture.shape
    scale = GRID_CELLS / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


Floats = NDArray[np.float64]

NOISE_FLOOR = 1e-4
"""Brightness below this is the camera's noise."""

_RESPONDS = 0.5
"""Share of the strongest response, in logarithms, from which a cell counts as reached by the flash."""
_UNREACHED, _LEAST_FOLLOWING = 0.1, 5
"""A cell goes along with the automatics alone if it follows the flash by at most so much more than the least following
ones (percentile) do. Automatics follow the flash too, mostly against it."""
_NOT_REACHED_AT_ALL = 0.35
"""If even those follow the flash by this share, it reaches everything."""
_VISIBLE = 0.003
_MIN_UNREACHED = 0.04
"""Share of all cells that must be unreached, so that they can stand for the automatics."""


@dataclass(frozen=True, eq=False)
class FlashSignal:
    """What the flash does to the picture.

    Attributes:
        level: (frames,) brightness of what the flash reaches, linear, gains divided out.
        reached: (rows, columns) which cells those are.
        gains: (frames,) brightness of what it does not reach, relative to its mean; 1 where there is no such part.
    """

    level: Floats
    reached: NDArray[np.bool_]
    gains: Floats

    @property
    def has_gains(self) -> bool:
        """Whether there was anything that the flash does not reach."""
        return bool(np.ptp(self.gains) > 0)


def reached_cells(brightness: BrightnessGrid, circle: FaceCircle | None = None) -> NDArray[np.bool_]:
    """Which cells (rows, columns) change most over the video, in ratio; of those in `circle` where it is given."""
    cells = brightness.cells.astype(np.float64) + NOISE_FLOOR
    response = np.log(np.percentile(cells, 95, axis=0) / np.percentile(cells, 5, axis=0))
    inside = np.ones(response.shape, bool) if circle is None else _inside(circle, brightness)
    if not inside.any():
        inside[:] = True
    return np.asarray(inside & (response >= _RESPONDS * np.percentile(response[inside], 95)))


def extract_flash_signal(brightness: BrightnessGrid, frequency_hz: float, reached: NDArray[np.bool_]) -> FlashSignal:
    """The curve of a light that blinks at about this frequency."""
    logarithm = np.log(brightness.cells.astype(np.float64) + NOISE_FLOOR)
    lag = max(1, round(0.5 / frequency_hz / brightness.interval_s))
    change = logarithm[lag:] - logarithm[:-lag]
    common = np.log(mean_level(brightness, reached) + NOISE_FLOOR)
    common = common[lag:] - common[:-lag]
    follows = np.tensordot(common, change, axes=1) / max(float(common @ common), 1e-12)
    visible = brightness.cells.mean(axis=0) > _VISIBLE
    least = float(np.percentile(follows[visible], _LEAST_FOLLOWING)) if visible.any() else 1.0
    unreached = visible & (follows < least + _UNREACHED)
    gains = np.ones(len(logarithm))
    if least < _NOT_REACHED_AT_ALL and unreached.mean() >= _MIN_UNREACHED:
        still = logarithm[:, unreached]
        gains = np.exp(np.median(still - still.mean(axis=0), axis=1))
    return FlashSignal(mean_level(brightness, reached) / gains, reached, gains)


def mean_level(brightness: BrightnessGrid, reached: NDArray[np.bool_]) -> Floats:
    """Mean brightness (frames,) of these cells (rows, columns)."""
    return np.asarray(brightness.cells[:, reached].mean(axis=1), np.float64)


def _inside(circle: FaceCircle, brightness: BrightnessGrid) -> NDArray[np.bool_]:
    rows, columns = brightness.cells.shape[1:]
    x = (np.arange(columns) + 0.5) * brightness.size[0] / columns
    y = (np.arange(rows) + 0.5) * brightness.size[1] / rows
    return np.asarray(np.hypot(x[None, :] - circle.x, y[:, None] - circle.y) < circle.radius)
