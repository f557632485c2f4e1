"""Exposure fractions: the fraction of an exposure for which the flash was on, measured in blocks of the picture.

They are measured about every edge of the flash, and predicted from a rolling shutter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.sparse import coo_array, csr_array

from relit_camera.base.array_types import Float64Array
from relit_camera.capture.film.flash.flash_schedule import FlashEdges
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid, FlashSignal


@dataclass(frozen=True)
class BlockTunables:
    """How fractions are measured; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        blocks: along either side of what the flash reaches.
        min_cells: fraction of the median number of cells below which a block is left out, as a highlight that moves on
            a ball is.
        frames: before and after an edge in which fractions are measured.
        min_reach, max_reach: frames about a frame among which the darkest and the brightest are sought.
    """

    blocks: int = 6
    min_cells: float = 0.3
    frames: int = 3
    min_reach: int = 3
    max_reach: int = 4


_TUNABLES = BlockTunables()


@dataclass(frozen=True, eq=False)
class BrightnessBlocks:
    """Brightness of blocks of the picture that the flash reaches.

    Attributes:
        level: (frames, blocks) linear, divided by the gains.
        place: (blocks, 2) centers x, y as fractions of the picture's width and height.
    """

    level: Float64Array
    place: Float64Array

    @classmethod
    def from_grid(cls, brightness: BrightnessGrid, signal: FlashSignal) -> BrightnessBlocks:
        """Up to 6 x 6 blocks of the cells that the flash reaches."""
        rows, columns = (np.flatnonzero(signal.reached.any(axis=axis)) for axis in (1, 0))
        cells = []
        for some_rows in np.array_split(rows, _TUNABLES.blocks):
            for some_columns in np.array_split(columns, _TUNABLES.blocks):
                y, x = np.nonzero(signal.reached[np.ix_(some_rows, some_columns)])
                cells.append((some_rows[y], some_columns[x]))
        least = _TUNABLES.min_cells * np.median([len(y) for y, _ in cells if len(y)])
        cells = [(y, x) for y, x in cells if len(y) >= max(least, 1)]
        level = np.stack([brightness.cells[:, y, x].mean(axis=1) / signal.gains for y, x in cells], axis=1)
        height, width = signal.reached.shape
        place = [[(x.mean() + 0.5) / width, (y.mean() + 0.5) / height] for y, x in cells]
        return cls(level.astype(np.float64), np.array(place))

    def local_extremes(self, period_frames: float) -> tuple[Float64Array, Float64Array]:
        """Minimum and maximum (frames, blocks) about each frame: first guesses of the unlit and the lit level."""
        reach = int(np.clip(round(period_frames / 2), _TUNABLES.min_reach, _TUNABLES.max_reach))
        low = minimum_filter1d(self.level, 2 * reach + 1, axis=0)
        return np.asarray(low), np.asarray(maximum_filter1d(self.level, 2 * reach + 1, axis=0))

    def between(self, frames: NDArray[np.intp]) -> Float64Array:
        """Levels (frames of the film, blocks) interpolated between some frames (count,), at least three.

        Each of these but the first and the last is itself replaced by the interpolation between its neighbors.
        """
        every, known = np.arange(len(self.level)), self.level[frames]
        levels = np.stack([np.interp(every, frames, block) for block in known.T], axis=1)
        way = ((frames[1:-1] - frames[:-2]) / (frames[2:] - frames[:-2]))[:, None]
        levels[frames[1:-1]] = known[:-2] * (1 - way) + known[2:] * way
        return levels


@dataclass(frozen=True, eq=False)
class ExposureFractions:
    """Exposure fractions measured in the frames about each edge of the flash.

    Attributes:
        since: (edges, frames, blocks) seconds from the first guess of the edge to the frame.
        place: (blocks,) position in the order of readout, as a fraction of the picture's height (or width).
        by_columns: whether columns are read one after another, not rows.
        fraction: (edges, frames, blocks) measured: 0 unlit, 1 lit throughout.
        root_weight: (edges, frames, blocks) square roots of their weights.
        rising: (edges,) whether the light goes on.
    """

    since: Float64Array
    place: Float64Array
    by_columns: bool
    fraction: Float64Array
    root_weight: Float64Array
    rising: NDArray[np.bool_]

    @classmethod
    def from_blocks(
        cls,
        blocks: BrightnessBlocks,
        by_columns: bool,
        times_s: Float64Array,
        edges: FlashEdges,
        unlit: Float64Array,
        lit: Float64Array,
    ) -> ExposureFractions:
        """Measure fractions about edges.

        Args:
            blocks: brightness of the film.
            by_columns: whether columns are read one after another, not rows.
            times_s: (frames,).
            edges: first guesses.
            unlit: (frames, blocks) levels of fraction 0.
            lit: (frames, blocks) levels of fraction 1.
        """
        about = edges.frame[:, None] + np.arange(1 - _TUNABLES.frames, 1 + _TUNABLES.frames)
        index = np.clip(about, 0, len(times_s) - 1)
        time = times_s[index]
        # Only frames nearer to this edge than to the ones before and after count for it.
        slack_s = float(np.median(np.diff(times_s))) / 4
        between = (edges.times_s[1:] + edges.times_s[:-1]) / 2
        known = (about == index) & (time >= np.append(-np.inf, between)[:, None] - slack_s)
        known &= time <= np.append(between, np.inf)[:, None] + slack_s
        height = np.maximum(lit - unlit, 1e-9)
        fraction = ((blocks.level - unlit) / height)[index]
        weight = known[..., None] * np.minimum(height / np.median(height), 1)[index]
        since = np.broadcast_to((time - edges.times_s[:, None])[..., None], fraction.shape)
        place = blocks.place[:, 0 if by_columns else 1]
        return cls(since, place, by_columns, np.clip(fraction, -0.5, 1.5), np.sqrt(weight), edges.rising)

    def expected(self, exposure_s: float, readout_s: float, offsets: Float64Array) -> Float64Array:
        """Predicted fractions (edges, frames, blocks), for edges later than guessed by offsets (edges,) in seconds."""
        lit = np.clip(self._progress(exposure_s, readout_s, offsets), 0, 1)
        return np.where(self.rising[:, None, None], lit, 1 - lit)

    def jacobian(self, exposure_s: float, readout_s: float, offsets: Float64Array) -> csr_array:
        """Derivatives (values, 2 + edges) of the weighted `expected` by exposure, readout and each offset."""
        progress = self._progress(exposure_s, readout_s, offsets)
        slope = np.where(self.rising, 1, -1)[:, None, None] * self.root_weight / exposure_s
        slope = slope * ((progress > 0) & (progress < 1))
        edges, each = len(offsets), progress[0].size
        rows = np.arange(progress.size)
        entries = [slope * (1 - progress), slope * self.place, -slope]
        columns = [np.zeros_like(rows), np.ones_like(rows), 2 + np.repeat(np.arange(edges), each)]
        values = np.concatenate([entry.ravel() for entry in entries])
        where = (np.tile(rows, 3), np.concatenate(columns))
        return csr_array(coo_array((values, where), shape=(len(rows), 2 + edges)))

    def _progress(self, exposure_s: float, readout_s: float, offsets: Float64Array) -> Float64Array:
        """Share (edges, frames, blocks) of the exposure after the edge, not limited to 0..1."""
        started = self.since + readout_s * self.place - offsets[:, None, None]
        return np.asarray((started + exposure_s) / exposure_s)
