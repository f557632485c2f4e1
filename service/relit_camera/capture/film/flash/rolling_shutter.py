"""When the light goes on and off to a fraction of a frame, told by the frames that it lights in part.

A row (or column) at share y of the picture is exposed from t + y · readout for `exposure_s`. A light that goes on at
time a is on for the share clip((t + y · readout + exposure − a) / exposure, 0, 1) of it. All edges of a video together
tell readout and exposure; that flashes come at nearly regular times tells the rest where few frames are lit in part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, dia_array, hstack, vstack
from scipy.sparse.linalg import spsolve

from relit_camera.capture.film.flash.exposure_fractions import BrightnessBlocks, ExposureFractions
from relit_camera.capture.film.flash.flash_schedule import (
    FULLY_LIT_FRACTION,
    FlashEdges,
    RollingShutter,
    schedule_from_edges,
)
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid, FlashSignal

Floats = NDArray[np.float64]

_TRIAL_EDGES = 48
"""At the video's beginning, on which shutters are tried."""
_ROUNDS = 2
"""Of measuring shares between frames found to be whole, and fitting again."""
_STEP_S = 0.002
_SHARE_NOISE = 0.04
"""Of a block's lit share: light and head move from frame to frame."""
_CLOCK_JITTER_S = (0.0001, 0.001, 0.005)
"""How much the clock of a flash may stray from one to the next: of a steady one, an app's, and one by hand. What is
more counts in proportion, not squared: a flash that jitters is followed where frames tell of it."""
_USUAL_EXPOSURE = 0.5
"""As a share of the frame interval. A flash in step with the frames tells only how exposure and readout compare: then
this decides, and else it counts for no more than one block of one frame."""
_ITERATIONS = 60
_ABOUT_AS_WELL = 1.25


def fit_rolling_shutter(
    brightness: BrightnessGrid, signal: FlashSignal, edges: FlashEdges, frequency_hz: float
) -> tuple[FlashEdges, RollingShutter]:
    """Edges to a fraction of a frame, and the shutter that explains them best.

    Args:
        brightness: brightness of the video.
        signal: what the flash reaches in it, and the gains.
        edges: first guesses.
        frequency_hz: about.

    Returns:
        The edges on the clock of the picture's first row (or column), and the shutter.
    """
    film = _Film(brightness.times_s, BrightnessBlocks.of(brightness, signal), edges, frequency_hz)
    beginning = film.beginning(_TRIAL_EDGES)
    trials = []
    for by_columns in (False, True):
        starts = _starts(beginning.first_shares(by_columns), brightness.interval_s)
        for jitter_s in _CLOCK_JITTER_S:
            fit = _Fit(beginning, beginning.first_shares(by_columns), jitter_s)
            best = min((fit.solve(start) for start in starts), key=fit.cost)
            fit, best = _between_whole_frames(fit, best)
            trials.append((jitter_s, fit.cost(best), by_columns, best[:2]))
    # The steadiest flash that explains the frames about as well as one that comes at any time.
    enough = _ABOUT_AS_WELL * min(cost for _, cost, *_ in trials)
    jitter_s, _, by_columns, shutter = min((each for each in trials if each[1] <= enough), key=lambda each: each[:2])
    fit = _Fit(film, film.first_shares(by_columns), jitter_s)
    offsets = _best_offsets(fit.shares, shutter[0], shutter[1], _offset_grid(brightness.interval_s))
    fit, best = _between_whole_frames(fit, fit.solve(np.concatenate([shutter, offsets])))
    return fit.refined(best), fit.shutter(best)


def _between_whole_frames(fit: _Fit, parameters: Floats) -> tuple[_Fit, Floats]:
    """The same fit, shares measured between frames that it finds to be lit wholly and not at all."""
    film = fit.film
    for _ in range(_ROUNDS):
        lit = schedule_from_edges(fit.refined(parameters)).lit_shares(film.times_s, fit.shutter(parameters))
        whole, dark = (
            np.flatnonzero(lit.min(axis=1) >= FULLY_LIT_FRACTION),
            np.flatnonzero(lit.max(axis=1) <= 1 - FULLY_LIT_FRACTION),
        )
        if len(whole) < 3 or len(dark) < 3:
            break
        fit = replace(fit, shares=film.shares(fit.shares.by_columns, dark, whole))
        parameters = fit.solve(parameters)
    return fit, parameters


@dataclass(frozen=True, eq=False)
class _Film:
    """What the shutter is fitted to.

    Attributes:
        times_s: (frames,).
        blocks: brightness of the frames.
        edges: first guesses.
        frequency_hz: of the flash, about.
    """

    times_s: Floats
    blocks: BrightnessBlocks
    edges: FlashEdges
    frequency_hz: float

    @property
    def interval_s(self) -> float:
        """The usual time from frame to frame."""
        return float(np.median(np.diff(self.times_s)))

    @cached_property
    def clock(self) -> csr_array:
        """Rows (sums, edges) whose sums of edge times vanish for a steady light."""
        return _clock_rows(self.edges.times_s, self.edges.rising, self.frequency_hz)

    def beginning(self, edges: int) -> _Film:
        """The part with the first so many edges."""
        if len(self.edges.times_s) <= edges:
            return self
        end = int(self.edges.frame[edges]) + 1
        blocks = replace(self.blocks, level=self.blocks.level[:end])
        return _Film(self.times_s[:end], blocks, self.edges.only(slice(0, edges)), self.frequency_hz)

    def first_shares(self, by_columns: bool) -> ExposureFractions:
        """Lit shares between the darkest and the brightest about each frame."""
        levels = self.blocks.local_extremes(1 / self.frequency_hz / self.interval_s)
        return ExposureFractions.of(self.blocks, by_columns, self.times_s, self.edges, *levels)

    def shares(self, by_columns: bool, dark: NDArray[np.intp], whole: NDArray[np.intp]) -> ExposureFractions:
        """Lit shares between dark and wholly lit frames."""
        levels = self.blocks.between(dark), self.blocks.between(whole)
        return ExposureFractions.of(self.blocks, by_columns, self.times_s, self.edges, *levels)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Exposure, readout and each edge's offset from its first guess, by robust least squares of shares and clock.

    Attributes:
        film: what it is fitted to.
        shares: measured about the edges.
        jitter_s: how much the film's clock may stray.
    """

    film: _Film
    shares: ExposureFractions
    jitter_s: float

    def refined(self, parameters: Floats) -> FlashEdges:
        """The edges that these parameters mean."""
        return replace(self.film.edges, times_s=self.film.edges.times_s + parameters[2:])

    def shutter(self, parameters: Floats) -> RollingShutter:
        """The shutter that they mean."""
        return RollingShutter(float(parameters[0]), float(parameters[1]), self.shares.by_columns, self.jitter_s)

    def solve(self, parameters: Floats) -> Floats:
        """The best parameters (2 + edges,) near these: Levenberg and Marquardt's way, reweighted for outliers.

        scipy's `least_squares` would need an iterative solver for these sparse systems, at twenty times the time.
        """
        limit_s = self.film.interval_s
        least, most = np.array([1e-3, -1.2 * limit_s]), np.array([limit_s, 1.2 * limit_s])
        damping, cost = 1e-3, np.inf
        candidate = parameters.copy()
        for _ in range(_ITERATIONS):
            candidate[:2] = np.clip(candidate[:2], least, most)
            residuals = self._residuals(candidate)
            reached = _robust(residuals)
            if reached < cost:
                if cost - reached < 1e-5 * reached:
                    return candidate
                parameters, cost, damping = candidate, reached, damping / 5
                jacobian = self._jacobian(parameters)
                weights = 1 / np.sqrt(1 + residuals**2)
                normal = csc_array(jacobian.T @ (jacobian * weights[:, None]))
                right = jacobian.T @ (weights * residuals)
            else:
                damping *= 10
            diagonal = normal.diagonal() + 1e-6 * normal.diagonal().max()
            damped = normal + dia_array((damping * diagonal + 1e-9, 0), shape=normal.shape)
            candidate = parameters - spsolve(damped, right)
        return parameters

    def cost(self, parameters: Floats) -> float:
        """How badly the shares are explained (robust, as they are fitted)."""
        return _robust(self._share_errors(parameters))

    def _residuals(self, parameters: Floats) -> Floats:
        strays = self.film.clock @ (self.film.edges.times_s + parameters[2:])
        usual = np.log(parameters[:1] / (_USUAL_EXPOSURE * self.film.interval_s))
        return np.concatenate([self._share_errors(parameters), strays / self.jitter_s, usual])

    def _jacobian(self, parameters: Floats) -> csr_array:
        of_shares = self.shares.jacobian(parameters[0], parameters[1], parameters[2:]) * (-1 / _SHARE_NOISE)
        of_clock = hstack([csr_array((self.film.clock.shape[0], 2)), self.film.clock / self.jitter_s])
        of_usual = csr_array(([1 / parameters[0]], ([0], [0])), shape=(1, len(parameters)))
        return csr_array(vstack([of_shares, of_clock, of_usual]))

    def _share_errors(self, parameters: Floats) -> Floats:
        error = self.shares.share - self.shares.expected(parameters[0], parameters[1], parameters[2:])
        return np.asarray((self.shares.root_weight * error).ravel() / _SHARE_NOISE)


def _robust(residuals: Floats) -> float:
    """Sum of squares near 0, of absolute values beyond 1."""
    return float(np.sum(np.sqrt(1 + residuals**2) - 1))


def _starts(shares: ExposureFractions, interval_s: float) -> list[Floats]:
    """Parameters to start from: for each way of reading out the best of a few exposures, each edge for itself."""
    grid = _offset_grid(interval_s)
    starts = []
    for readouts in ((-0.8, -0.5, -0.25), (0.0,), (0.25, 0.5, 0.8)):
        pairs = [(exposure * interval_s, readout * interval_s) for exposure in (0.2, 0.5, 0.9) for readout in readouts]
        best = min(pairs, key=lambda pair: float(_costs(shares, pair[0], pair[1], grid).min(axis=0).mean()))
        starts.append(np.concatenate([best, _best_offsets(shares, best[0], best[1], grid)]))
    return starts


def _costs(shares: ExposureFractions, exposure_s: float, readout_s: float, grid: Floats) -> Floats:
    """Mean absolute error of the shares (offsets, edges) at each of the offsets (offsets,)."""
    edges, weight = len(shares.rising), shares.root_weight**2
    errors = (shares.share - shares.expected(exposure_s, readout_s, np.full(edges, offset)) for offset in grid)
    return np.array([(weight * np.abs(error)).mean(axis=(1, 2)) for error in errors])


def _best_offsets(shares: ExposureFractions, exposure_s: float, readout_s: float, grid: Floats) -> Floats:
    """The offset (edges,) that explains each edge best; the middle of those that do about equally well."""
    costs = _costs(shares, exposure_s, readout_s, grid)
    good = costs <= costs.min(axis=0) + 0.002
    return np.asarray((good * grid[:, None]).sum(axis=0) / good.sum(axis=0))


def _offset_grid(interval_s: float) -> Floats:
    return np.arange(-1.2 * interval_s, 3.2 * interval_s, _STEP_S)


def _clock_rows(times_s: Floats, rising: NDArray[np.bool_], frequency_hz: float) -> csr_array:
    """Sums of edge times that vanish for a steady light, as rows (sums, edges).

    An edge lies between its neighbours of the same kind in proportion to the flashes counted between them, and the
    light is on for as long as the time before.
    """
    rows: list[dict[int, float]] = []
    for kind in (True, False):
        same = np.flatnonzero(rising == kind).tolist()
        count = np.cumsum(np.maximum(np.round(np.diff(times_s[same], prepend=times_s[same[:1]]) * frequency_hz), 1))
        for place in range(1, len(same) - 1):
            way = (count[place] - count[place - 1]) / (count[place + 1] - count[place - 1])
            rows.append({same[place]: 1.0, same[place - 1]: float(way - 1), same[place + 1]: float(-way)})
    for one, other in pairwise(np.flatnonzero(rising[:-1]).tolist()):
        rows.append({other + 1: 1.0, other: -1.0, one + 1: -1.0, one: 1.0})
    entries = [(row, column, value) for row, terms in enumerate(rows) for column, value in terms.items()]
    row, column, value = (np.array(part) for part in zip(*entries, strict=True))
    return csr_array(coo_array((value, (row, column)), shape=(len(rows), len(rising))))
