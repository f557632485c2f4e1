"""How brightness runs across the limb of a mirror ball.

Toward its limb a mirror ball shows what is behind it: at the limb itself rays pass unbent, and the picture goes over
into the background with no step but for the light that the metal takes. The edges that one sees lie inside, where the
squeezed mirror image of something else begins: one or two hundredths of the radius, which is a degree of light. So the
limb is sought not as an edge but as the place up to which the picture is background.

A mirror ball's outline, as well as its picture tells.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fmin

from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView

INSIDE_SAMPLES, OUTSIDE_SAMPLES = 16, 12
"""Samples on both sides of the supposed limb."""
SHIFTS = np.arange(-6, 6.01, 0.3)
"""Places of the limb that are tried, in sample distances."""

_BLACK, _LEVEL, _BLUR = 0.0003, 0.02, 0.03
"""Errors of a picture: one code of dark sRGB; a share of the brightness; a share of the contrast, for what is not known
of the lens's blur and a video's compression."""
_REFLECTION_VARIANCES = (1e1, 1e2, 1e3, 1e4, 1e5)
"""Variance a radian that the mirrored surroundings may have, and ..."""
_BACKGROUND_VARIANCES = ((0.03, 0.0), (1.0, 3.0), (100.0, 10.0))
"""... a sample that the background may have, in units of the error's variance, with how much less likely it is taken to
be (logarithm): a background is mostly plain so near. Of both, what fits a profile best counts."""
_ABSORBED, _ABSORBED_SPREAD = 0.15, 0.12
"""Share of the light that metal takes, and its spread."""
_ANY_LEVEL = 1e6
_BLUR_SAMPLES = 5

Floats = NDArray[np.float64]


class OutlineProfileModel:
    """Likelihood of brightness profiles across the limb, for each place that it may have in them.

    A Gaussian process. Outside, a profile is a random walk in pixels from an unknown level. Inside, it goes on from the
    level at the limb, less what the metal takes, as a random walk in the angle by which the ball turns the rays: that
    is 2 acos(ρ) at ρ radii from the middle, so it sets in steeply. The lens blurs both.
    """

    def __init__(self, step_px: float, radius: float, blur_px: float) -> None:
        """Prepare for profiles sampled every `step_px` across the limb of a ball of this radius, pixels."""
        self.places = np.arange(-INSIDE_SAMPLES, OUTSIDE_SAMPLES + 1) * step_px
        samples = len(self.places)
        margin = 4 * blur_px + step_px
        fine = np.arange(self.places[0] - margin, self.places[-1] + margin, step_px / _BLUR_SAMPLES)
        lens = np.exp(-0.5 * ((self.places[:, None] - fine) / blur_px) ** 2)
        lens /= lens.sum(axis=1, keepdims=True)
        inverse = np.empty((len(SHIFTS), len(_REFLECTION_VARIANCES) * len(_BACKGROUND_VARIANCES), samples, samples))
        self._offset = np.empty(inverse.shape[:2])
        steps = np.empty((len(SHIFTS), samples))
        for index, shift in enumerate(SHIFTS * step_px):
            turn = 2 * np.arccos(np.clip(1 - np.maximum(shift - fine, 0) / radius, -1, 1))
            away = np.maximum(fine - shift, 0) / step_px
            steps[index] = lens @ (fine < shift)
            walk, clutter = (lens @ np.minimum.outer(way, way) @ lens.T for way in (turn, away))
            fixed = (
                (_ABSORBED_SPREAD / _LEVEL) ** 2 * np.outer(steps[index], steps[index]) + _ANY_LEVEL + np.eye(samples)
            )
            scales = [(a, b) for a in _REFLECTION_VARIANCES for b in _BACKGROUND_VARIANCES]
            for column, (walk_scale, (clutter_scale, unlikely)) in enumerate(scales):
                lower = np.linalg.cholesky(fixed + walk_scale * walk + clutter_scale * clutter)
                half = np.linalg.inv(lower)
                inverse[index, column] = half.T @ half
                self._offset[index, column] = np.log(np.diag(lower)).sum() + unlikely
        stepped = np.einsum("dkuv,dv->dku", inverse, steps)
        self._inverse = inverse.reshape(-1, samples, samples).transpose(1, 0, 2).reshape(samples, -1)
        self._stepped = stepped.reshape(-1, samples).T
        self._step_squared = np.einsum("dku,du->dk", stepped, steps)

    def log_likelihood(self, light: NDArray[np.float32], x: Floats, y: Floats) -> Floats:
        """Log likelihood (count, shifts) of the profiles at pixels x, y (count, samples) of luminance (h, w)."""
        at = [(place - 0.5).astype(np.float32) for place in (x, y)]
        profile = cv2.remap(light, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
        outside = np.median(profile[:, -OUTSIDE_SAMPLES // 2 :], axis=1, keepdims=True)
        level = np.median(profile, axis=1, keepdims=True)
        error = _BLACK + _LEVEL * level + _BLUR * np.ptp(profile, axis=1, keepdims=True)
        profile /= error
        taken = _ABSORBED * (outside / error)[..., None]
        shape = (len(profile), *self._offset.shape)
        # (profile + taken · step)ᵀ K⁻¹ (profile + taken · step), multiplied out.
        halves = (profile @ self._inverse).reshape(len(profile), -1, profile.shape[1])
        squared = np.einsum("nkv,nv->nk", halves, profile).reshape(shape)
        squared += 2 * taken * (profile @ self._stepped).reshape(shape) + taken**2 * self._step_squared
        return np.asarray((-0.5 * squared - self._offset).max(axis=2))


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


@dataclass(frozen=True)
class MirrorOutlineFit:
    """A fitted outline.

    Attributes:
        outline: in pixels.
        evidence: share of the rays from its middle along which the limb shows where it was found.
        log_focal, log_focal_error: natural logarithm of the focal length in pixels, and its standard error: what was
            known, and what the outline's shape says about it.
    """

    outline: BallOutline
    evidence: float
    log_focal: float
    log_focal_error: float


def fit_mirror_outline(
    lights: NDArray[np.float32], rough: BallOutline, log_focal: float, log_focal_error: float
) -> MirrorOutlineFit:
    """Fit the outline of a mirror ball.

    Args:
        lights: linear luminance (count, height, width) of one scene; each picture counts the same.
        rough: the outline within two per cent of the radius or three pixels.
        log_focal: natural logarithm of the focal length in pixels, as far as it is known.
        log_focal_error: its standard error.
    """
    step = max(_STEP_PX, _STEP_RADII * rough.radius)
    models = [OutlineProfileModel(step, rough.radius, blur) for blur in _BLURS_PX if blur < 2.5 * step]
    found, prior = np.array([rough.x, rough.y, rough.radius, log_focal]), (log_focal, log_focal_error)
    evidence = 0.0
    for turn in range(_ROUNDS):
        rays = [_Rays(lights, model, found) for model in models]
        fits = [each.best_outline(each.searched() if turn == 0 else found, prior) for each in rays]
        chosen = int(np.argmax([each.peak + score for each, (_, score) in zip(rays, fits, strict=True)]))
        found = fits[chosen][0]
        evidence = rays[chosen].evidence(found)
    outline = BallOutline(float(found[0]), float(found[1]), float(found[2]))
    # An ellipse's stretch falls with the focal length's square; so sure is what the fitted stretch says of it.
    stretch = 2 * np.log(PinholeView(outline, (lights.shape[2], lights.shape[1]), float(np.exp(log_focal))).elongation)
    error = np.sqrt(2) * _OUTLINE_ERROR_PX / max(evidence, 0.1) / outline.radius / max(stretch, 1e-9)
    share = log_focal_error**2 / (log_focal_error**2 + error**2)
    combined = log_focal + share * float(found[3] - log_focal)
    return MirrorOutlineFit(outline, evidence, combined, float(log_focal_error * np.sqrt(1 - share)))


class _Rays:
    """What the rays from a ball's middle say of its outline: x, y, radius, logarithm of the focal length."""

    def __init__(self, lights: NDArray[np.float32], model: OutlineProfileModel, base: Floats) -> None:
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
        view = PinholeView(BallOutline(x, y, radius), self._size, float(np.exp(log_focal)))
        stretch = np.sqrt(view.elongation)
        from_axis = angle - np.arctan2(y - self._size[1] / 2, x - self._size[0] / 2)
        return np.asarray(radius / np.hypot(np.cos(from_axis) / stretch, np.sin(from_axis) * stretch))


def _robust(value: Floats, beyond: Floats) -> Floats:
    """Sum over the rays (last axis) of log likelihoods, none below the outliers'."""
    return np.asarray(np.logaddexp(value - beyond, -_OUTLIER).sum(axis=-1) - 0.01 * beyond.sum(axis=-1))
