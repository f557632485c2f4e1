"""The brightness of a film on a coarse grid, and from it the flash signal: one value a frame, camera gains removed.

The grid is all that is kept of a film for finding its flashes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array
from relit_camera.base.errors import VideoError
from relit_camera.base.images.color import Gamma, luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_camera.base.video.video_readers import LinearVideoReader
from relit_camera.capture.film.face_circle import FaceCircle

GRID_CELLS = 32
"""Cells along the longer side."""
_PIXELS_PER_CELL = 8
"""Pixels a side of a cell in the small pictures to which frames are decoded; even 4K then costs little more than
decoding."""
MIN_FRAMES = 8
"""Least frames of a film."""
NOISE_FLOOR = 1e-4
"""Linear brightness below which there is only the camera's noise."""


@dataclass(frozen=True)
class SignalTunables:
    """Which cells the flash reaches; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        min_response: fraction of the strongest response (logarithm) from which a cell counts as reached by the flash.
        least_following: percentile of the cells' regression on the flash that stands for the camera's gains alone;
            automatic exposure follows the flash too, mostly against it.
        following_margin: a cell shows the gains if its regression exceeds that by no more.
        reached_everywhere: if the percentile exceeds this, the flash reaches everything.
        min_visible: least mean brightness of a cell that shows the gains.
        min_unreached: least fraction of all cells that must show the gains.
    """

    min_response: float = 0.5
    least_following: float = 5
    following_margin: float = 0.1
    reached_everywhere: float = 0.35
    min_visible: float = 0.003
    min_unreached: float = 0.04


_TUNABLES = SignalTunables()


@dataclass(frozen=True, eq=False)
class BrightnessGrid:
    """Brightness of every frame of a film in a grid over the upright picture.

    Attributes:
        cells: (frames, rows, columns) float32 mean luminance, linear; the film's white is 1.
        times_s: (frames,) float64 presentation times, growing.
        size: width and height of the film's upright pictures in pixels.
        brightest_picture: small uint8 sRGB picture, for each pixel the maximum over the frames; it shows the face.
    """

    cells: NDArray[np.float32]
    times_s: NDArray[np.float64]
    size: tuple[int, int]
    brightest_picture: DisplayImage

    @property
    def interval_s(self) -> float:
        """Median time from frame to frame."""
        return float(np.median(np.diff(self.times_s)))


def measure_brightness(
    path: Path,
    gamma: Gamma = "srgb",
    *,
    threads: int = 1,
    most: int | None = None,
    progress: Callable[[int], None] = lambda frames: None,
) -> BrightnessGrid:
    """Read a film once at low resolution. Memory: 4 KB a frame.

    Args:
        path: the film.
        gamma: its transfer curve.
        threads: of the decoder.
        most: frames that are read; all if None.
        progress: called with the number of frames read.

    Raises:
        VideoError: as `base.video.video_readers.LinearVideoReader`, or it has fewer than eight frames.
    """
    cells, times_s = [], []
    brightest: LinearImage | None = None
    with LinearVideoReader(path, gamma, longer_side=GRID_CELLS * _PIXELS_PER_CELL, threads=threads) as video:
        for frame in video:
            brightest = frame.image if brightest is None else np.maximum(brightest, frame.image)
            cells.append(cell_means(luminance(frame.image)))
            times_s.append(frame.time_s)
            progress(len(times_s))
            if len(times_s) == most:
                break
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


@dataclass(frozen=True, eq=False)
class FlashSignal:
    """Brightness of what the flash reaches, frame by frame.

    Attributes:
        level: (frames,) linear brightness of the reached cells, divided by the gains.
        reached: (rows, columns) mask of those cells.
        gains: (frames,) brightness of the cells that the flash does not reach, relative to its mean; all 1 where there
            are too few.
    """

    level: Float64Array
    reached: NDArray[np.bool_]
    gains: Float64Array


def reached_cells(brightness: BrightnessGrid, circle: FaceCircle | None = None) -> NDArray[np.bool_]:
    """Mask (rows, columns) of the cells whose brightness varies most in ratio, inside a circle where it is given."""
    cells = brightness.cells.astype(np.float64) + NOISE_FLOOR
    response = np.log(np.percentile(cells, 95, axis=0) / np.percentile(cells, 5, axis=0))
    inside = np.ones(response.shape, bool) if circle is None else _inside(circle, brightness)
    if not inside.any():
        inside[:] = True
    return np.asarray(inside & (response >= _TUNABLES.min_response * np.percentile(response[inside], 95)))


def extract_flash_signal(brightness: BrightnessGrid, frequency_hz: float, reached: NDArray[np.bool_]) -> FlashSignal:
    """The signal of a light that blinks at about this frequency.

    Args:
        brightness: of the film.
        frequency_hz: of the flashes, about.
        reached: (rows, columns) mask of the cells that the flash reaches.
    """
    logarithm = np.log(brightness.cells.astype(np.float64) + NOISE_FLOOR)
    lag = max(1, round(0.5 / frequency_hz / brightness.interval_s))
    change = logarithm[lag:] - logarithm[:-lag]
    common = np.log(mean_level(brightness, reached) + NOISE_FLOOR)
    common = common[lag:] - common[:-lag]
    following = np.tensordot(common, change, axes=1) / max(float(common @ common), 1e-12)
    visible = brightness.cells.mean(axis=0) > _TUNABLES.min_visible
    least = float(np.percentile(following[visible], _TUNABLES.least_following)) if visible.any() else 1.0
    unreached = visible & (following < least + _TUNABLES.following_margin)
    gains = np.ones(len(logarithm))
    if least < _TUNABLES.reached_everywhere and unreached.mean() >= _TUNABLES.min_unreached:
        room = logarithm[:, unreached]
        gains = np.exp(np.median(room - room.mean(axis=0), axis=1))
    return FlashSignal(mean_level(brightness, reached) / gains, reached, gains)


def mean_level(brightness: BrightnessGrid, reached: NDArray[np.bool_]) -> Float64Array:
    """Mean brightness (frames,) of the cells of a mask (rows, columns)."""
    return np.asarray(brightness.cells[:, reached].mean(axis=1), np.float64)


def _inside(circle: FaceCircle, brightness: BrightnessGrid) -> NDArray[np.bool_]:
    """Mask (rows, columns) of the cells whose centers are in a circle given in the film's pixels."""
    rows, columns = brightness.cells.shape[1:]
    x = (np.arange(columns) + 0.5) * brightness.size[0] / columns
    y = (np.arange(rows) + 0.5) * brightness.size[1] / rows
    return np.asarray(np.hypot(x[None, :] - circle.x, y[:, None] - circle.y) < circle.radius)
