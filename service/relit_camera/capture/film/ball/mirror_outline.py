"""A mirror ball's outline measured to a fraction of a pixel, by a model of the brightness across its limb.

A mirror ball has no edge at its limb. There it reflects what is behind it, and at the limb itself rays pass unbent, so
the picture blends into the background but for the light that the metal absorbs. The visible edges lie one or two
hundredths of the radius inside, where the squeezed reflection of something else begins; that would be an error of a
degree of light. So the limb is found as the place up to which a brightness profile is background
(`OutlineProfileModel`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fmin

from relit_camera.base.array_types import Float64Array
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView

INSIDE_SAMPLES, OUTSIDE_SAMPLES = 16, 12
"""Samples of a profile on either side of the supposed limb."""
SHIFTS = np.arange(-6, 6.01, 0.3)
"""Positions of the limb that are tried, in sample distances from the supposed one."""


@dataclass(frozen=True)
class ProfileTunables:
    """Noise and priors of a profile; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        black_error: error of a dark picture: one sRGB code, linear.
        level_error: error as a fraction of the brightness.
        blur_error: error as a fraction of the contrast, by the unknown part of lens blur and compression.
        reflection_variances: variances per radian of the reflected surroundings that are tried, over that of the error.
        background_variances: variances per sample of the background that are tried, over that of the error, each with
            its negative log prior: a background this near is mostly plain.
        absorption, absorption_error: fraction of the light that metal absorbs, and its standard deviation.
        level_variance: variance of the unknown brightness, over that of the error: practically unlimited.
        blur_samples: steps per sample distance in which the lens blur is integrated.
    """

    black_error: float = 0.0003
    level_error: float = 0.02
    blur_error: float = 0.03
    reflection_variances: tuple[float, ...] = (1e1, 1e2, 1e3, 1e4, 1e5)
    background_variances: tuple[tuple[float, float], ...] = ((0.03, 0.0), (1.0, 3.0), (100.0, 10.0))
    absorption: float = 0.15
    absorption_error: float = 0.12
    level_variance: float = 1e6
    blur_samples: int = 5


@dataclass(frozen=True)
class OutlineTunables:
    """Fit of the outline; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        step_px, step_radii: distance of the samples across the limb: the larger of the two.
        blurs_px: standard deviations of the lens blur that are tried.
        rays: number of profiles around the ball.
        samples_per_value: samples that count as one independent value, since neighbors along and across the limb are
            correlated.
        outlier: log likelihood below its best that a ray may lose at most: the weight of one without a limb.
        evidence: log likelihood by which a ray must prefer the limb over any other position to be evidence of it.
        grid: offsets of x, y and radius that are tried first, in sample distances.
        rounds: fits, each about the outline of the one before.
        error_px: standard error of a diameter of a limb that is visible all around. Where parts are missing, both ends
            of a diameter are seldom visible.
    """

    step_px: float = 0.5
    step_radii: float = 1 / 300
    blurs_px: tuple[float, ...] = (0.5, 1.0, 2.0)
    rays: int = 240
    samples_per_value: float = 6.0
    outlier: float = 5.0
    evidence: float = 1.0
    grid: tuple[float, ...] = tuple(float(offset) for offset in range(-5, 6))
    rounds: int = 3
    error_px: float = 0.4


_PROFILE = ProfileTunables()
_OUTLINE = OutlineTunables()


class OutlineProfileModel:
    """Likelihood of brightness profiles across the limb, for each position of the limb that is tried.

    The profile is a Gaussian process. Outside, it is a random walk in pixels from an unknown level. Inside, it
    continues from the level at the limb, less what the metal absorbs, as a random walk in the angle by which the ball
    turns the rays: that is 2 acos(ρ) at ρ radii from the center, so it varies steeply near the limb. The lens blurs
    both.
    """

    def __init__(self, step_px: float, radius: float, blur_px: float) -> None:
        """Invert the covariances of the profiles.

        Args:
            step_px: distance of the samples across the limb.
            radius: of the ball, pixels.
            blur_px: standard deviation of the lens blur.
        """
        self.places = np.arange(-INSIDE_SAMPLES, OUTSIDE_SAMPLES + 1) * step_px
        samples = len(self.places)
        margin = 4 * blur_px + step_px
        fine = np.arange(self.places[0] - margin, self.places[-1] + margin, step_px / _PROFILE.blur_samples)
        lens = np.exp(-0.5 * ((self.places[:, None] - fine) / blur_px) ** 2)
        lens /= lens.sum(axis=1, keepdims=True)
        scales = [(a, b) for a in _PROFILE.reflection_variances for b in _PROFILE.background_variances]
        inverse = np.empty((len(SHIFTS), len(scales), samples, samples))
        self._offset = np.empty(inverse.shape[:2])
        steps = np.empty((len(SHIFTS), samples))
        for index, shift in enumerate(SHIFTS * step_px):
            turn = 2 * np.arccos(np.clip(1 - np.maximum(shift - fine, 0) / radius, -1, 1))
            away = np.maximum(fine - shift, 0) / step_px
            steps[index] = lens @ (fine < shift)
            reflection, background = (lens @ np.minimum.outer(way, way) @ lens.T for way in (turn, away))
            fixed = (
                (_PROFILE.absorption_error / _PROFILE.level_error) ** 2 * np.outer(steps[index], steps[index])
                + _PROFILE.level_variance
                + np.eye(samples)
            )
            for column, (reflection_scale, (background_scale, prior_cost)) in enumerate(scales):
                lower = np.linalg.cholesky(fixed + reflection_scale * reflection + background_scale * background)
                half = np.linalg.inv(lower)
                inverse[index, column] = half.T @ half
                self._offset[index, column] = np.log(np.diag(lower)).sum() + prior_cost
        stepped = np.einsum("dkuv,dv->dku", inverse, steps)
        self._inverse = inverse.reshape(-1, samples, samples).transpose(1, 0, 2).reshape(samples, -1)
        self._stepped = stepped.reshape(-1, samples).T
        self._step_squared = np.einsum("dku,du->dk", stepped, steps)

    def log_likelihood(self, light: NDArray[np.float32], x: Float64Array, y: Float64Array) -> Float64Array:
        """Log likelihood (count, shifts) of profiles.

        Args:
            light: linear luminance (height, width) float32.
            x: (count, samples) pixel positions of the profiles' samples.
            y: the same.
        """
        at = [(place - 0.5).astype(np.float32) for place in (x, y)]
        profile = cv2.remap(light, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
        outside = np.median(profile[:, -OUTSIDE_SAMPLES // 2 :], axis=1, keepdims=True)
        level = np.median(profile, axis=1, keepdims=True)
        error = (
            _PROFILE.black_error
            + _PROFILE.level_error * level
            + _PROFILE.blur_error * np.ptp(profile, axis=1, keepdims=True)
        )
        profile /= error
        taken = _PROFILE.absorption * (outside / error)[..., None]
        shape = (len(profile), *self._offset.shape)
        # (profile + taken · step)ᵀ K⁻¹ (profile + taken · step), multiplied out.
        halves = (profile @ self._inverse).reshape(len(profile), -1, profile.shape[1])
        squared = np.einsum("nkv,nv->nk", halves, profile).reshape(shape)
        squared += 2 * taken * (profile @ self._stepped).reshape(shape) + taken**2 * self._step_squared
        return np.asarray((-0.5 * squared - self._offset).max(axis=2))


@dataclass(frozen=True)
class MirrorOutlineFit:
    """A measured outline of a mirror ball.

    Attributes:
        outline: in pixels.
        evidence: fraction of the rays from its center along which the limb is evident where it was found.
        log_focal, log_focal_error: natural logarithm of the focal length in pixels, and its standard error: prior
            knowledge combined with that from the outline's shape.
    """

    outline: BallOutline
    evidence: float
    log_focal: float
    log_focal_error: float


def fit_mirror_outline(
    lights: NDArray[np.float32], rough: BallOutline, log_focal: float, log_focal_error: float
) -> MirrorOutlineFit:
    """Measure the outline of a mirror ball.

    Args:
        lights: linear luminance (count, height, width) of one scene; all pictures count equally.
        rough: the outline to within two per cent of the radius or three pixels.
        log_focal: natural logarithm of the focal length in pixels, as far as it is known.
        log_focal_error: its standard error.
    """
    step = max(_OUTLINE.step_px, _OUTLINE.step_radii * rough.radius)
    models = [OutlineProfileModel(step, rough.radius, blur) for blur in _OUTLINE.blurs_px if blur < 2.5 * step]
    found, prior = np.array([rough.x, rough.y, rough.radius, log_focal]), (log_focal, log_focal_error)
    evidence = 0.0
    for number in range(_OUTLINE.rounds):
        rays = [_Rays(lights, model, found) for model in models]
        fits = [each.best_outline(each.best_of_grid() if number == 0 else found, prior) for each in rays]
        chosen = int(np.argmax([each.peak + score for each, (_, score) in zip(rays, fits, strict=True)]))
        found = fits[chosen][0]
        evidence = rays[chosen].evidence(found)
    outline = BallOutline(float(found[0]), float(found[1]), float(found[2]))
    # The stretch of the ellipse is inverse to the square of the focal length, which gives the error of the latter.
    stretch = 2 * np.log(PinholeView(outline, (lights.shape[2], lights.shape[1]), float(np.exp(log_focal))).elongation)
    error = np.sqrt(2) * _OUTLINE.error_px / max(evidence, 0.1) / outline.radius / max(stretch, 1e-9)
    fraction = log_focal_error**2 / (log_focal_error**2 + error**2)
    combined = log_focal + fraction * float(found[3] - log_focal)
    return MirrorOutlineFit(outline, evidence, combined, float(log_focal_error * np.sqrt(1 - fraction)))


class _Rays:
    """Log likelihoods of outlines by the profiles along rays from a ball's center.

    An outline is an array of x, y, radius in pixels and the natural logarithm of the focal length in pixels.
    """

    def __init__(self, lights: NDArray[np.float32], model: OutlineProfileModel, base: Float64Array) -> None:
        """Sample profiles along rays from the center of the outline `base`, across its line."""
        angle = (np.arange(_OUTLINE.rays) + 0.5) * 2 * np.pi / _OUTLINE.rays
        self._size, self._base = (lights.shape[2], lights.shape[1]), base
        self._step = float(model.places[1] - model.places[0])
        distance = self._line(base, angle)[:, None] + model.places
        x, y = base[0] + distance * np.cos(angle)[:, None], base[1] + distance * np.sin(angle)[:, None]
        inside = ((x > 0) & (y > 0) & (x < self._size[0]) & (y < self._size[1])).all(axis=1)
        self._angle = angle[inside]
        likely = (
            np.mean([model.log_likelihood(light, x[inside], y[inside]) for light in lights], axis=0)
            / _OUTLINE.samples_per_value
        )
        best = likely.max(axis=1, keepdims=True, initial=-np.inf)
        self.peak = float(best.sum())
        self._likely = likely - best

    def best_of_grid(self) -> Float64Array:
        """The most likely of a grid of outlines about the base, with the base's focal length."""
        across, down, wide = (grid.ravel() for grid in np.meshgrid(_OUTLINE.grid, _OUTLINE.grid, _OUTLINE.grid))
        offset = across[:, None] * np.cos(self._angle) + down[:, None] * np.sin(self._angle) + wide[:, None]
        value, beyond = self._interpolate(offset)
        best = int(np.argmax(_robust(value, beyond)))
        return self._base + self._step * np.array([across[best], down[best], wide[best], 0])

    def best_outline(self, start: Float64Array, prior: tuple[float, float]) -> tuple[Float64Array, float]:
        """The most likely outline near a start, and its log likelihood.

        Args:
            start: outline at which the simplex search (Nelder and Mead 1965) starts.
            prior: logarithm of the focal length and its standard error.
        """

        def cost(parameters: Float64Array) -> float:
            prior_cost = 0.5 * ((parameters[3] - prior[0]) / prior[1]) ** 2
            return float(prior_cost - _robust(*self._interpolate(self._offsets(parameters))))

        sides = np.diag([self._step, self._step, self._step, prior[1]])
        simplex = start + np.vstack([np.zeros(4), sides])
        best = np.asarray(fmin(cost, start, initial_simplex=simplex, xtol=3e-3, ftol=1e-2, disp=False))
        return best, -cost(best)

    def evidence(self, parameters: Float64Array) -> float:
        """Fraction of all rays that clearly prefer the limb at this outline over other positions."""
        value, beyond = self._interpolate(self._offsets(parameters))
        telling = (value - self._likely.mean(axis=1) > _OUTLINE.evidence / _OUTLINE.samples_per_value) & (beyond == 0)
        return float(np.count_nonzero(telling) / _OUTLINE.rays)

    def _offsets(self, parameters: Float64Array) -> Float64Array:
        """Distance (rays,) of an outline's line outside the base's, in sample distances."""
        moved = parameters[0] - self._base[0], parameters[1] - self._base[1]
        wider = self._line(parameters, self._angle) - self._line(self._base, self._angle)
        return np.asarray((wider + moved[0] * np.cos(self._angle) + moved[1] * np.sin(self._angle)) / self._step)

    def _interpolate(self, offset: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Log likelihood (..., rays) of a limb at an offset, relative to the best, and the offset's excess."""
        column = (offset - SHIFTS[0]) / (SHIFTS[1] - SHIFTS[0])
        inside = np.clip(column, 0, len(SHIFTS) - 1.001)
        left, ray = inside.astype(int), np.arange(len(self._likely))
        part = inside - left
        value = self._likely[ray, left] * (1 - part) + self._likely[ray, left + 1] * part
        return np.asarray(value), np.abs(column - inside)

    def _line(self, parameters: Float64Array, angle: Float64Array) -> Float64Array:
        """Distance (rays,) of an outline's line from its center, in pixels."""
        x, y, radius, log_focal = parameters
        view = PinholeView(BallOutline(x, y, radius), self._size, float(np.exp(log_focal)))
        stretch = np.sqrt(view.elongation)
        from_axis = angle - np.arctan2(y - self._size[1] / 2, x - self._size[0] / 2)
        return np.asarray(radius / np.hypot(np.cos(from_axis) / stretch, np.sin(from_axis) * stretch))


def _robust(value: Float64Array, beyond: Float64Array) -> Float64Array:
    """Sum over the rays (last axis) of log likelihoods, with a lower limit for outliers."""
    return np.asarray(np.logaddexp(value - beyond, -_OUTLINE.outlier).sum(axis=-1) - 0.01 * beyond.sum(axis=-1))
