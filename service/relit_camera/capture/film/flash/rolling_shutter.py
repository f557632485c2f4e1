"""The camera's rolling shutter, and the flash's edges to a fraction of a frame, from partly lit frames.

A row (or column) at fraction y of the picture is exposed from t + y · readout for `exposure_s`. A light that goes on at
time a is on for the fraction clip((t + y · readout + exposure − a) / exposure, 0, 1) of it. Readout and exposure are
fitted to all edges of a film together; where few frames are partly lit, the nearly regular times of the flashes
determine the rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, dia_array, hstack, vstack
from scipy.sparse.linalg import spsolve

from relit_camera.base.array_types import Float64Array
from relit_camera.capture.film.flash.exposure_fractions import BrightnessBlocks, ExposureFractions
from relit_camera.capture.film.flash.flash_schedule import (
    FULLY_LIT_FRACTION,
    FlashEdges,
    RollingShutter,
    schedule_from_edges,
)
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid, FlashSignal


@dataclass(frozen=True)
class ShutterTunables:
    """Fit of the shutter; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        trial_edges: edges at the film's beginning on which shutters are tried.
        rounds: times that fractions are measured between frames found to be fully lit and unlit, and fitted again.
        step_s: distance of the edge offsets that are tried.
        fraction_error: standard error of a block's exposure fraction, by motion of light and head between frames.
        jitters_s: standard deviations of the flash's period that are tried: of a steady one, of an app's, and by hand.
            Larger deviations count linearly, not squared, so a flash that jitters is followed where frames show it.
        typical_exposure: exposure as a fraction of the frame interval. A flash in step with the frames shows only the
            relation of exposure and readout: then this prior decides; else it counts no more than one block.
        iterations: most iterations of the fit.
        tolerance: ratio of the cost to the best at which the steadier flash is preferred.
    """

    trial_edges: int = 48
    rounds: int = 2
    step_s: float = 0.002
    fraction_error: float = 0.04
    jitters_s: tuple[float, ...] = (0.0001, 0.001, 0.005)
    typical_exposure: float = 0.5
    iterations: int = 60
    tolerance: float = 1.25


_TUNABLES = ShutterTunables()


def fit_rolling_shutter(
    brightness: BrightnessGrid, signal: FlashSignal, edges: FlashEdges, frequency_hz: float
) -> tuple[FlashEdges, RollingShutter]:
    """Fit edges and shutter to the exposure fractions of a film.

    Args:
        brightness: of the film.
        signal: which cells the flash reaches, and the gains.
        edges: first guesses.
        frequency_hz: of the flashes, about.

    Returns:
        The edges on the clock of the picture's first row (or column), to a fraction of a frame, and the shutter.
    """
    film = _Film(brightness.times_s, BrightnessBlocks.from_grid(brightness, signal), edges, frequency_hz)
    beginning = film.beginning(_TUNABLES.trial_edges)
    trials = []
    for by_columns in (False, True):
        starts = _starts(beginning.first_fractions(by_columns), brightness.interval_s)
        for jitter_s in _TUNABLES.jitters_s:
            fit = _Fit(beginning, beginning.first_fractions(by_columns), jitter_s)
            best = min((fit.solve(start) for start in starts), key=fit.cost)
            fit, best = _remeasure(fit, best)
            trials.append((jitter_s, fit.cost(best), by_columns, best[:2]))
    # The steadiest flash that explains the frames about as well as the best fit.
    enough = _TUNABLES.tolerance * min(cost for _, cost, *_ in trials)
    jitter_s, _, by_columns, shutter = min((each for each in trials if each[1] <= enough), key=lambda each: each[:2])
    fit = _Fit(film, film.first_fractions(by_columns), jitter_s)
    offsets = _best_offsets(fit.fractions, shutter[0], shutter[1], _offset_grid(brightness.interval_s))
    fit, best = _remeasure(fit, fit.solve(np.concatenate([shutter, offsets])))
    return fit.refined(best), fit.shutter(best)


def _remeasure(fit: _Fit, parameters: Float64Array) -> tuple[_Fit, Float64Array]:
    """A fit with fractions measured between the frames that this one finds fully lit and unlit, and its parameters."""
    film = fit.film
    for _ in range(_TUNABLES.rounds):
        lit = schedule_from_edges(fit.refined(parameters)).exposure_fractions(film.times_s, fit.shutter(parameters))
        fully_lit = np.flatnonzero(lit.min(axis=1) >= FULLY_LIT_FRACTION)
        dark = np.flatnonzero(lit.max(axis=1) <= 1 - FULLY_LIT_FRACTION)
        if len(fully_lit) < 3 or len(dark) < 3:
            break
        fit = replace(fit, fractions=film.fractions(fit.fractions.by_columns, dark, fully_lit))
        parameters = fit.solve(parameters)
    return fit, parameters


@dataclass(frozen=True, eq=False)
class _Film:
    """The part of a film to which a shutter is fitted.

    Attributes:
        times_s: (frames,).
        blocks: brightness of the frames.
        edges: first guesses.
        frequency_hz: of the flashes, about.
    """

    times_s: Float64Array
    blocks: BrightnessBlocks
    edges: FlashEdges
    frequency_hz: float

    @property
    def interval_s(self) -> float:
        """Median time from frame to frame."""
        return float(np.median(np.diff(self.times_s)))

    @cached_property
    def clock(self) -> csr_array:
        """Matrix (sums, edges) whose product with the edge times vanishes for a steady light."""
        return _clock_rows(self.edges.times_s, self.edges.rising, self.frequency_hz)

    def beginning(self, edges: int) -> _Film:
        """The part with the first `edges` edges."""
        if len(self.edges.times_s) <= edges:
            return self
        end = int(self.edges.frame[edges]) + 1
        blocks = replace(self.blocks, level=self.blocks.level[:end])
        return _Film(self.times_s[:end], blocks, self.edges.subset(slice(0, edges)), self.frequency_hz)

    def first_fractions(self, by_columns: bool) -> ExposureFractions:
        """Fractions between the darkest and the brightest level about each frame."""
        levels = self.blocks.local_extremes(1 / self.frequency_hz / self.interval_s)
        return ExposureFractions.from_blocks(self.blocks, by_columns, self.times_s, self.edges, *levels)

    def fractions(self, by_columns: bool, dark: NDArray[np.intp], fully_lit: NDArray[np.intp]) -> ExposureFractions:
        """Fractions between the levels of dark and of fully lit frames, given by their indices."""
        levels = self.blocks.between(dark), self.blocks.between(fully_lit)
        return ExposureFractions.from_blocks(self.blocks, by_columns, self.times_s, self.edges, *levels)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Robust least-squares fit of exposure, readout and each edge's offset to exposure fractions and a regular period.

    Parameters are an array (2 + edges,): exposure, readout, and the offsets of the edges from the first guesses, in
    seconds.

    Attributes:
        film: what the shutter is fitted to.
        fractions: exposure fractions about the edges.
        jitter_s: standard deviation of the flash's period.
    """

    film: _Film
    fractions: ExposureFractions
    jitter_s: float

    def refined(self, parameters: Float64Array) -> FlashEdges:
        """The edges with these parameters."""
        return replace(self.film.edges, times_s=self.film.edges.times_s + parameters[2:])

    def shutter(self, parameters: Float64Array) -> RollingShutter:
        """The shutter with these parameters."""
        return RollingShutter(float(parameters[0]), float(parameters[1]), self.fractions.by_columns, self.jitter_s)

    def solve(self, parameters: Float64Array) -> Float64Array:
        """The best parameters near these, by the Levenberg-Marquardt method reweighted for outliers.

        scipy's `least_squares` would need an iterative solver for these sparse systems and take twenty times as long.
        """
        limit_s = self.film.interval_s
        least, most = np.array([1e-3, -1.2 * limit_s]), np.array([limit_s, 1.2 * limit_s])
        damping, cost = 1e-3, np.inf
        candidate = parameters.copy()
        for _ in range(_TUNABLES.iterations):
            candidate[:2] = np.clip(candidate[:2], least, most)
            residuals = self._residuals(candidate)
            new_cost = _robust(residuals)
            if new_cost < cost:
                if cost - new_cost < 1e-5 * new_cost:
                    return candidate
                parameters, cost, damping = candidate, new_cost, damping / 5
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

    def cost(self, parameters: Float64Array) -> float:
        """Robust cost of the exposure fractions alone."""
        return _robust(self._fraction_errors(parameters))

    def _residuals(self, parameters: Float64Array) -> Float64Array:
        deviations = self.film.clock @ (self.film.edges.times_s + parameters[2:])
        prior = np.log(parameters[:1] / (_TUNABLES.typical_exposure * self.film.interval_s))
        return np.concatenate([self._fraction_errors(parameters), deviations / self.jitter_s, prior])

    def _jacobian(self, parameters: Float64Array) -> csr_array:
        of_fractions = self.fractions.jacobian(parameters[0], parameters[1], parameters[2:]) * (
            -1 / _TUNABLES.fraction_error
        )
        of_clock = hstack([csr_array((self.film.clock.shape[0], 2)), self.film.clock / self.jitter_s])
        of_prior = csr_array(([1 / parameters[0]], ([0], [0])), shape=(1, len(parameters)))
        return csr_array(vstack([of_fractions, of_clock, of_prior]))

    def _fraction_errors(self, parameters: Float64Array) -> Float64Array:
        error = self.fractions.fraction - self.fractions.expected(parameters[0], parameters[1], parameters[2:])
        return np.asarray((self.fractions.root_weight * error).ravel() / _TUNABLES.fraction_error)


def _robust(residuals: Float64Array) -> float:
    """Pseudo-Huber loss: sums squares near 0, absolute values beyond 1."""
    return float(np.sum(np.sqrt(1 + residuals**2) - 1))


def _starts(fractions: ExposureFractions, interval_s: float) -> list[Float64Array]:
    """Start parameters: for readout upward, at once and downward the best of a few exposures, each edge independent."""
    grid = _offset_grid(interval_s)
    starts = []
    for readouts in ((-0.8, -0.5, -0.25), (0.0,), (0.25, 0.5, 0.8)):
        pairs = [(exposure * interval_s, readout * interval_s) for exposure in (0.2, 0.5, 0.9) for readout in readouts]
        best = min(pairs, key=lambda pair: float(_costs(fractions, pair[0], pair[1], grid).min(axis=0).mean()))
        starts.append(np.concatenate([best, _best_offsets(fractions, best[0], best[1], grid)]))
    return starts


def _costs(fractions: ExposureFractions, exposure_s: float, readout_s: float, grid: Float64Array) -> Float64Array:
    """Mean absolute error (offsets, edges) of the fractions, for each offset of a grid (offsets,)."""
    edges, weight = len(fractions.rising), fractions.root_weight**2
    errors = (fractions.fraction - fractions.expected(exposure_s, readout_s, np.full(edges, offset)) for offset in grid)
    return np.array([(weight * np.abs(error)).mean(axis=(1, 2)) for error in errors])


def _best_offsets(
    fractions: ExposureFractions, exposure_s: float, readout_s: float, grid: Float64Array
) -> Float64Array:
    """Best offset (edges,) of each edge on a grid (offsets,); the mean of those that are about equally good."""
    costs = _costs(fractions, exposure_s, readout_s, grid)
    good = costs <= costs.min(axis=0) + 0.002
    return np.asarray((good * grid[:, None]).sum(axis=0) / good.sum(axis=0))


def _offset_grid(interval_s: float) -> Float64Array:
    """Offsets (offsets,) in seconds from one frame before the first guess of an edge to three after it."""
    return np.arange(-1.2 * interval_s, 3.2 * interval_s, _TUNABLES.step_s)


def _clock_rows(times_s: Float64Array, rising: NDArray[np.bool_], frequency_hz: float) -> csr_array:
    """Matrix (sums, edges) whose product with the edge times vanishes for a steady light.

    An edge lies between its neighbors of the same kind in proportion to the number of flashes between them, and every
    flash is as long as the one before.
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
