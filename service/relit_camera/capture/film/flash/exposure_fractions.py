"""How much of each block's exposure was lit, measured, about every edge of the flash, and what a shutter predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.sparse import coo_array, csr_array

from relit_camera.capture.film.flash.flash_schedule import FlashEdges
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid, FlashSignal

Floats = NDArray[np.float64]

_BLOCKS = 6
"""Along either side of what the flash reaches."""
_SMALL = 0.3
"""Blocks with less than this share of the usual number of cells are left out: a highlight that moves on a ball."""
_NEAR = 3
"""Frames looked at before and after an edge."""
_LEAST_REACH, _MOST_REACH = 3, 4
"""Frames about a frame among which the darkest and the brightest are sought."""


@dataclass(frozen=True, eq=False)
class BrightnessBlocks:
    """Brightness of blocks of the picture that the flash reaches.

    Attributes:
        level: (frames, blocks) linear, gains divided out.
        place: (blocks, 2) middles x, y as shares of the picture's width and height.
    """

    level: Floats
    place: Floats

    @classmethod
    def of(cls, brightness: BrightnessGrid, signal: FlashSignal) -> BrightnessBlocks:
        """Up to 6 x 6 blocks of the video's cells."""
        rows, columns = (np.flatnonzero(signal.reached.any(axis=axis)) for axis in (1, 0))
        cells = []
        for some_rows in np.array_split(rows, _BLOCKS):
            for some_columns in np.array_split(columns, _BLOCKS):
                y, x = np.nonzero(signal.reached[np.ix_(some_rows, some_columns)])
                cells.append((some_rows[y], some_columns[x]))
        least = _SMALL * np.median([len(y) for y, _ in cells if len(y)])
        cells = [(y, x) for y, x in cells if len(y) >= max(least, 1)]
        level = np.stack([brightness.cells[:, y, x].mean(axis=1) / signal.gains for y, x in cells], axis=1)
        height, width = signal.reached.shape
        place = [[(x.mean() + 0.5) / width, (y.mean() + 0.5) / height] for y, x in cells]
        return cls(level.astype(np.float64), np.array(place))

    def local_extremes(self, period_frames: float) -> tuple[Floats, Floats]:
        """The darkest and the brightest (frames, blocks) about each frame: a first guess of unlit and lit."""
        reach = int(np.clip(round(period_frames / 2), _LEAST_REACH, _MOST_REACH))
        low = minimum_filter1d(self.level, 2 * reach + 1, axis=0)
        return np.asarray(low), np.asarray(maximum_filter1d(self.level, 2 * reach + 1, axis=0))

    def between(self, frames: NDArray[np.intp]) -> Floats:
        """Levels (frames of the video, blocks) interpolated between some frames (count,), three at least.

        One of these frames counts nothing for itself: its level is that between the ones before and after it.
        """
        every, known = np.arange(len(self.level)), self.level[frames]
        levels = np.stack([np.interp(every, frames, block) for block in known.T], axis=1)
        way = ((frames[1:-1] - frames[:-2]) / (frames[2:] - frames[:-2]))[:, None]
        levels[frames[1:-1]] = known[:-2] * (1 - way) + known[2:] * way
        return levels


@dataclass(frozen=True, eq=False)
class ExposureFractions:
    """Lit shares about each edge.

    Attributes:
        since: (edges, frames, blocks) seconds from the edge's first guess to each frame.
        place: (blocks,) share of the picture's height (or width).
        share: (edges, frames, blocks) measured: 0 unlit, 1 lit throughout.
        root_weight: (edges, frames, blocks).
        rising: (edges,).
    """

    since: Floats
    place: Floats
    by_columns: bool
    share: Floats
    root_weight: Floats
    rising: NDArray[np.bool_]

    @classmethod
    def of(
        cls, blocks: BrightnessBlocks, by_columns: bool, times_s: Floats, edges: FlashEdges, unlit: Floats, lit: Floats
    ) -> ExposureFractions:
        """The shares between levels unlit and lit (frames, blocks)."""
        about = edges.frame[:, None] + np.arange(1 - _NEAR, 1 + _NEAR)
        index = np.clip(about, 0, len(times_s) - 1)
        time = times_s[index]
        # Not beyond the middle between two edges: what is there belongs to the other one.
        slack_s = float(np.median(np.diff(times_s))) / 4
        between = (edges.times_s[1:] + edges.times_s[:-1]) / 2
        known = (about == index) & (time >= np.append(-np.inf, between)[:, None] - slack_s)
        known &= time <= np.append(between, np.inf)[:, None] + slack_s
        height = np.maximum(lit - unlit, 1e-9)
        share = ((blocks.level - unlit) / height)[index]
        weight = known[..., None] * np.minimum(height / np.median(height), 1)[index]
        since = np.broadcast_to((time - edges.times_s[:, None])[..., None], share.shape)
        place = blocks.place[:, 0 if by_columns else 1]
        return cls(since, place, by_columns, np.clip(share, -0.5, 1.5), np.sqrt(weight), edges.rising)

    def only(self, some: slice) -> ExposureFractions:
        """Of some of the edges."""
        return replace(
            self,
            since=self.since[some],
            share=self.share[some],
            root_weight=self.root_weight[some],
            rising=self.rising[some],
        )

    def expected(self, exposure_s: float, readout_s: float, offsets: Floats) -> Floats:
        """Shares (edges, frames, blocks) for edges so much later than guessed (edges,)."""
        lit = np.clip(self._progress(exposure_s, readout_s, offsets), 0, 1)
        return np.where(self.rising[:, None, None], lit, 1 - lit)

    def jacobian(self, exposure_s: float, readout_s: float, offsets: Floats) -> csr_array:
        """Of the weighted `expected` by exposure, readout and each offset: (values, 2 + edges)."""
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

    def _progress(self, exposure_s: float, readout_s: float, offsets: Floats) -> Floats:
        started = self.since + readout_s * self.place - offsets[:, None, None]
        return np.asarray((started + exposure_s) / exposure_s)
