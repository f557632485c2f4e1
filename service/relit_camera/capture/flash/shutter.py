"""When the light goes on and off to a fraction of a frame, told by the frames that it lights in part.

A row (or column) at share y of the picture is exposed from t + y · readout for `exposure_s`. A light that goes on at
time a is on for the share clip((t + y · readout + exposure − a) / exposure, 0, 1) of it. All edges of a video together
tell readout and exposure; that flashes come at nearly regular times tells the rest where few frames are lit in part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, dia_array, hstack, vstack
from scipy.sparse.linalg import spsolve

from relit_camera.capture.flash.brightness import Brightness
from relit_camera.capture.flash.edges import Edges
from relit_camera.capture.flash.lit_shares import Blocks, LitShares
from relit_camera.capture.flash.schedule import WHOLE, Shutter, schedule_of
from relit_camera.capture.flash.signal import Signal

Floats = NDArray[np.float64]

_TRIAL_EDGES = 48
"""At the video's beginning, on which shutters are tried."""
_ROUNDS = 2
"""Of measuring shares between frames found to be whole, and fitting again."""
_STEP_S = 0.002
_SHARE_NOISE = 0.04
"""Of a block's lit share: light and head move from frame to frame."""
_UNSTEADY_S = (0.0001, 0.001, 0.005)
"""How much the clock of a flash may stray from one to the next: of a steady one, an app's, and one by hand. What is
more counts in proportion, not squared: a flash that jitters is followed where frames tell of it."""
_ITERATIONS = 60
_ABOUT_AS_WELL = 1.25


def fit_shutter(seen: Brightness, signal: Signal, edges: Edges, frequency_hz: float) -> tuple[Edges, Shutter]:
    """Edges to a fraction of a frame, and the shutter that explains them best.

    Args:
        seen: brightness of the video.
        signal: what the flash reaches in it, and the gains.
        edges: first guesses.
        frequency_hz: about.

    Returns:
        The edges on the clock of the picture's first row (or column), and the shutter.
    """
    period_frames = 1 / frequency_hz / seen.interval_s
    clock = _clock_rows(edges.times_s, edges.rising, frequency_hz)
    some = slice(0, _TRIAL_EDGES)
    trial_clock = _clock_rows(edges.times_s[some], edges.rising[some], frequency_hz)
    trials: list[list[tuple[float, _Fit, Floats]]] = [[] for _ in _UNSTEADY_S]
    blocks = Blocks.of(seen, signal)
    extremes = blocks.local_extremes(period_frames)
    for by_columns in (False, True):
        shares = LitShares.of(blocks, by_columns, seen.times_s, edges, *extremes)
        starts = _starts(shares.only(some), seen.interval_s)
        for unsteady_s, found in zip(_UNSTEADY_S, trials, strict=True):
            whole = _Fit(seen, blocks, edges, clock, unsteady_s, shares)
            trial = replace(whole, edges=edges.only(some), clock=trial_clock, shares=shares.only(some))
            solved = [trial.solve(start) for start in starts]
            found += [(trial.cost(parameters), whole, parameters[:2]) for parameters in solved]
    fits = [_with_whole_frames(*min(found, key=lambda each: each[0])[1:]) for found in trials]
    # The steadiest flash that explains the frames about as well as one that comes at any time.
    enough = _ABOUT_AS_WELL * min(fit.cost(parameters) for fit, parameters in fits)
    fit, parameters = next((fit, parameters) for fit, parameters in fits if fit.cost(parameters) <= enough)
    return fit.refined(parameters), fit.shutter(parameters)


def _with_whole_frames(fit: _Fit, shutter: Floats) -> tuple[_Fit, Floats]:
    """The fit of all edges from a shutter (2,) on, shares measured between frames that are found to be whole."""
    offsets = _best_offsets(fit.shares, shutter[0], shutter[1], _offset_grid(fit.seen.interval_s))
    parameters = fit.solve(np.concatenate([shutter, offsets]))
    times_s = fit.seen.times_s
    for _ in range(_ROUNDS):
        lit = schedule_of(fit.refined(parameters)).lit_shares(times_s, fit.shutter(parameters))
        whole, dark = np.flatnonzero(lit.min(axis=1) >= WHOLE), np.flatnonzero(lit.max(axis=1) <= 1 - WHOLE)
        if len(whole) < 2 or len(dark) < 2:
            break
        levels = fit.blocks.between(dark), fit.blocks.between(whole)
        fit = replace(fit, shares=LitShares.of(fit.blocks, fit.shares.by_columns, times_s, fit.edges, *levels))
        parameters = fit.solve(parameters)
    return fit, parameters


@dataclass(frozen=True, eq=False)
class _Fit:
    """Exposure, readout and each edge's offset from its first guess, by robust least squares of shares and clock.

    Attributes:
        seen: the video, whose frame interval bounds exposure and readout.
        blocks: its brightness.
        edges: first guesses.
        clock: rows whose sums of edge times vanish for a steady light.
        unsteady_s: how much those sums may differ from 0.
        shares: measured about the edges.
    """

    seen: Brightness
    blocks: Blocks
    edges: Edges
    clock: csr_array
    unsteady_s: float
    shares: LitShares

    def refined(self, parameters: Floats) -> Edges:
        """The edges that these parameters mean."""
        return replace(self.edges, times_s=self.edges.times_s + parameters[2:])

    def shutter(self, parameters: Floats) -> Shutter:
        """The shutter that they mean."""
        return Shutter(float(parameters[0]), float(parameters[1]), self.shares.by_columns, self.unsteady_s)

    def solve(self, parameters: Floats) -> Floats:
        """The best parameters (2 + edges,) near these: Levenberg and Marquardt's way, reweighted for outliers.

        scipy's `least_squares` would need an iterative solver for these sparse systems, at twenty times the time.
        """
        limit_s = self.seen.interval_s
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
        strays = self.clock @ (self.edges.times_s + parameters[2:])
        return np.concatenate([self._share_errors(parameters), strays / self.unsteady_s])

    def _jacobian(self, parameters: Floats) -> csr_array:
        of_shares = self.shares.jacobian(parameters[0], parameters[1], parameters[2:]) * (-1 / _SHARE_NOISE)
        of_clock = hstack([csr_array((self.clock.shape[0], 2)), self.clock / self.unsteady_s])
        return csr_array(vstack([of_shares, of_clock]))

    def _share_errors(self, parameters: Floats) -> Floats:
        error = self.shares.share - self.shares.expected(parameters[0], parameters[1], parameters[2:])
        return np.asarray((self.shares.root_weight * error).ravel() / _SHARE_NOISE)


def _robust(residuals: Floats) -> float:
    """Sum of squares near 0, of absolute values beyond 1."""
    return float(np.sum(np.sqrt(1 + residuals**2) - 1))


def _starts(shares: LitShares, interval_s: float) -> list[Floats]:
    """Parameters to start from: for each way of reading out the best of a few exposures, each edge for itself."""
    grid = _offset_grid(interval_s)
    starts = []
    for readouts in ((-0.8, -0.5, -0.25), (0.0,), (0.25, 0.5, 0.8)):
        pairs = [(exposure * interval_s, readout * interval_s) for exposure in (0.2, 0.5, 0.9) for readout in readouts]
        best = min(pairs, key=lambda pair: float(_costs(shares, pair[0], pair[1], grid).min(axis=0).mean()))
        starts.append(np.concatenate([best, _best_offsets(shares, best[0], best[1], grid)]))
    return starts


def _costs(shares: LitShares, exposure_s: float, readout_s: float, grid: Floats) -> Floats:
    """Mean absolute error of the shares (offsets, edges) at each of the offsets (offsets,)."""
    edges, weight = len(shares.rising), shares.root_weight**2
    errors = (shares.share - shares.expected(exposure_s, readout_s, np.full(edges, offset)) for offset in grid)
    return np.array([(weight * np.abs(error)).mean(axis=(1, 2)) for error in errors])


def _best_offsets(shares: LitShares, exposure_s: float, readout_s: float, grid: Floats) -> Floats:
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
