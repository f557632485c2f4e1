"""A mirror ball's outline, as well as its picture tells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fmin

from relit_camera.capture.ball.limb_model import SHIFTS, LimbModel
from relit_camera.capture.ball.outline import Outline
from relit_camera.capture.ball.view import PinholeView

_STEP_PX, _STEP_RADII = 0.5, 1 / 300
"""Distance of the samples across the limb: the larger of the two."""
_BLURS_PX = (0.5, 1.0, 2.0)
_RAYS = 240
_OVERLAP = 6.0
"""Each sample says again what its neighbours along and across the limb said: so many count as one."""
_OUTLIER = 5.0
"""Least log likelihood of a ray, below its best: so little weight has one that shows something else than the limb."""
_TELLING = 1.0
"""Log likelihood by which a ray must prefer the limb where it is to anywhere, to be evidence of it."""
_GRID = np.arange(-5.0, 5.1, 1.0)
"""Offsets of x, y and radius that are tried first, in sample distances."""
_ROUNDS = 3
_OUTLINE_ERROR_PX = 0.4
"""Of the outline along a diameter: what compression and clutter leave of a limb that shows all around. Where parts are
missing, a diameter's two ends are seldom both seen."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MirrorLimb:
    """A fitted outline.

    Attributes:
        outline: in pixels.
        evidence: share of the rays from its middle along which the limb shows where it was found.
        log_focal, log_focal_error: natural logarithm of the focal length in pixels, and its standard error: what was
            known, and what the outline's shape says about it.
    """

    outline: Outline
    evidence: float
    log_focal: float
    log_focal_error: float


def fit_mirror_limb(
    lights: NDArray[np.float32], rough: Outline, log_focal: float, log_focal_error: float
) -> MirrorLimb:
    """Fit the outline of a mirror ball.

    Args:
        lights: linear luminance (count, height, width) of one scene; each picture counts the same.
        rough: the outline within two per cent of the radius or three pixels.
        log_focal: natural logarithm of the focal length in pixels, as far as it is known.
        log_focal_error: its standard error.
    """
    step = max(_STEP_PX, _STEP_RADII * rough.radius)
    models = [LimbModel(step, rough.radius, blur) for blur in _BLURS_PX if blur < 2.5 * step]
    found, prior = np.array([rough.x, rough.y, rough.radius, log_focal]), (log_focal, log_focal_error)
    evidence = 0.0
    for turn in range(_ROUNDS):
        rays = [_Rays(lights, model, found) for model in models]
        fits = [each.best_outline(each.searched() if turn == 0 else found, prior) for each in rays]
        chosen = int(np.argmax([each.peak + score for each, (_, score) in zip(rays, fits, strict=True)]))
        found = fits[chosen][0]
        evidence = rays[chosen].evidence(found)
    outline = Outline(float(found[0]), float(found[1]), float(found[2]))
    # An ellipse's stretch falls with the focal length's square; so sure is what the fitted stretch says of it.
    stretch = 2 * np.log(PinholeView(outline, (lights.shape[2], lights.shape[1]), float(np.exp(log_focal))).elongation)
    error = np.sqrt(2) * _OUTLINE_ERROR_PX / max(evidence, 0.1) / outline.radius / max(stretch, 1e-9)
    share = log_focal_error**2 / (log_focal_error**2 + error**2)
    combined = log_focal + share * float(found[3] - log_focal)
    return MirrorLimb(outline, evidence, combined, float(log_focal_error * np.sqrt(1 - share)))


class _Rays:
    """What the rays from a ball's middle say of its outline: x, y, radius, logarithm of the focal length."""

    def __init__(self, lights: NDArray[np.float32], model: LimbModel, base: Floats) -> None:
        """Look along rays from the middle of `base`, across its line."""
        angle = (np.arange(_RAYS) + 0.5) * 2 * np.pi / _RAYS
        self._size, self._base = (lights.shape[2], lights.shape[1]), base
        self._step = float(model.places[1] - model.places[0])
        distance = self._line(base, angle)[:, None] + model.places
        x, y = base[0] + distance * np.cos(angle)[:, None], base[1] + distance * np.sin(angle)[:, None]
        seen = ((x > 0) & (y > 0) & (x < self._size[0]) & (y < self._size[1])).all(axis=1)
        self._angle = angle[seen]
        likely = np.mean([model.log_likelihood(light, x[seen], y[seen]) for light in lights], axis=0) / _OVERLAP
        best = likely.max(axis=1, keepdims=True, initial=-np.inf)
        self.peak = float(best.sum())
        self._likely = likely - best

    def searched(self) -> Floats:
        """The best of a grid of outlines about the base, with its focal length."""
        across, down, wide = (grid.ravel() for grid in np.meshgrid(_GRID, _GRID, _GRID))
        off = across[:, None] * np.cos(self._angle) + down[:, None] * np.sin(self._angle) + wide[:, None]
        value, beyond = self._at(off)
        best = int(np.argmax(_robust(value, beyond)))
        return self._base + self._step * np.array([across[best], down[best], wide[best], 0])

    def best_outline(self, start: Floats, prior: tuple[float, float]) -> tuple[Floats, float]:
        """The outline that the rays and what is known of the focal length prefer, and its log likelihood."""

        def cost(parameters: Floats) -> float:
            known = 0.5 * ((parameters[3] - prior[0]) / prior[1]) ** 2
            return float(known - _robust(*self._at(self._off(parameters))))

        sides = np.diag([self._step, self._step, self._step, prior[1]])
        simplex = start + np.vstack([np.zeros(4), sides])
        best = np.asarray(fmin(cost, start, initial_simplex=simplex, xtol=3e-3, ftol=1e-2, disp=False))
        return best, -cost(best)

    def evidence(self, parameters: Floats) -> float:
        """Share of all rays that prefer the limb there to anywhere."""
        value, beyond = self._at(self._off(parameters))
        telling = (value - self._likely.mean(axis=1) > _TELLING / _OVERLAP) & (beyond == 0)
        return float(np.count_nonzero(telling) / _RAYS)

    def _off(self, parameters: Floats) -> Floats:
        """How far (rays,) an outline's line is outside the base's, in sample distances."""
        moved = parameters[0] - self._base[0], parameters[1] - self._base[1]
        wider = self._line(parameters, self._angle) - self._line(self._base, self._angle)
        return np.asarray((wider + moved[0] * np.cos(self._angle) + moved[1] * np.sin(self._angle)) / self._step)

    def _at(self, off: Floats) -> tuple[Floats, Floats]:
        """Log likelihoods (..., rays), 0 the best, of a limb so far off, and how far that is outside what was tried."""
        column = (off - SHIFTS[0]) / (SHIFTS[1] - SHIFTS[0])
        inside = np.clip(column, 0, len(SHIFTS) - 1.001)
        left, ray = inside.astype(int), np.arange(len(self._likely))
        part = inside - left
        value = self._likely[ray, left] * (1 - part) + self._likely[ray, left + 1] * part
        return np.asarray(value), np.abs(column - inside)

    def _line(self, parameters: Floats, angle: Floats) -> Floats:
        """Distance (rays,) of an outline from its centre."""
        x, y, radius, log_focal = parameters
        view = PinholeView(Outline(x, y, radius), self._size, float(np.exp(log_focal)))
        stretch = np.sqrt(view.elongation)
        from_axis = angle - np.arctan2(y - self._size[1] / 2, x - self._size[0] / 2)
        return np.asarray(radius / np.hypot(np.cos(from_axis) / stretch, np.sin(from_axis) * stretch))


def _robust(value: Floats, beyond: Floats) -> Floats:
    """Sum over the rays (last axis) of log likelihoods, none below the outliers'."""
    return np.asarray(np.logaddexp(value - beyond, -_OUTLIER).sum(axis=-1) - 0.01 * beyond.sum(axis=-1))
