"""How brightness runs across the limb of a mirror ball.

Toward its limb a mirror ball shows what is behind it: at the limb itself rays pass unbent, and the picture goes over
into the background with no step but for the light that the metal takes. The edges that one sees lie inside, where the
squeezed mirror image of something else begins: one or two hundredths of the radius, which is a degree of light. So the
limb is sought not as an edge but as the place up to which the picture is background.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

INSIDE, OUTSIDE = 16, 12
"""Samples on both sides of the supposed limb."""
SHIFTS = np.arange(-6, 6.01, 0.3)
"""Places of the limb that are tried, in sample distances."""

_BLACK, _LEVEL, _BLUR = 0.0003, 0.02, 0.03
"""Errors of a picture: one code of dark sRGB; a share of the brightness; a share of the contrast, for what is not known
of the lens's blur and a video's compression."""
_WALKS = (1e1, 1e2, 1e3, 1e4, 1e5)
"""Variance a radian that the mirrored surroundings may have, and ..."""
_CLUTTERS = ((0.03, 0.0), (1.0, 3.0), (100.0, 10.0))
"""... a sample that the background may have, in units of the error's variance, with how much less likely it is taken to
be (logarithm): a background is mostly plain so near. Of both, what fits a profile best counts."""
_TAKEN, _TAKEN_SPREAD = 0.15, 0.12
"""Share of the light that metal takes, and its spread."""
_ANY_LEVEL = 1e6
_BLUR_SAMPLES = 5

Floats = NDArray[np.float64]


class LimbModel:
    """Likelihood of brightness profiles across the limb, for each place that it may have in them.

    A Gaussian process. Outside, a profile is a random walk in pixels from an unknown level. Inside, it goes on from the
    level at the limb, less what the metal takes, as a random walk in the angle by which the ball turns the rays: that
    is 2 acos(ρ) at ρ radii from the middle, so it sets in steeply. The lens blurs both.
    """

    def __init__(self, step_px: float, radius: float, blur_px: float) -> None:
        """Prepare for profiles sampled every `step_px` across the limb of a ball of this radius, pixels."""
        self.places = np.arange(-INSIDE, OUTSIDE + 1) * step_px
        samples = len(self.places)
        margin = 4 * blur_px + step_px
        fine = np.arange(self.places[0] - margin, self.places[-1] + margin, step_px / _BLUR_SAMPLES)
        lens = np.exp(-0.5 * ((self.places[:, None] - fine) / blur_px) ** 2)
        lens /= lens.sum(axis=1, keepdims=True)
        inverse = np.empty((len(SHIFTS), len(_WALKS) * len(_CLUTTERS), samples, samples))
        self._offset = np.empty(inverse.shape[:2])
        steps = np.empty((len(SHIFTS), samples))
        for index, shift in enumerate(SHIFTS * step_px):
            turn = 2 * np.arccos(np.clip(1 - np.maximum(shift - fine, 0) / radius, -1, 1))
            away = np.maximum(fine - shift, 0) / step_px
            steps[index] = lens @ (fine < shift)
            walk, clutter = (lens @ np.minimum.outer(way, way) @ lens.T for way in (turn, away))
            fixed = (_TAKEN_SPREAD / _LEVEL) ** 2 * np.outer(steps[index], steps[index]) + _ANY_LEVEL + np.eye(samples)
            scales = [(a, b) for a in _WALKS for b in _CLUTTERS]
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
        outside = np.median(profile[:, -OUTSIDE // 2 :], axis=1, keepdims=True)
        level = np.median(profile, axis=1, keepdims=True)
        error = _BLACK + _LEVEL * level + _BLUR * np.ptp(profile, axis=1, keepdims=True)
        profile /= error
        taken = _TAKEN * (outside / error)[..., None]
        shape = (len(profile), *self._offset.shape)
        # (profile + taken · step)ᵀ K⁻¹ (profile + taken · step), multiplied out.
        halves = (profile @ self._inverse).reshape(len(profile), -1, profile.shape[1])
        squared = np.einsum("nkv,nv->nk", halves, profile).reshape(shape)
        squared += 2 * taken * (profile @ self._stepped).reshape(shape) + taken**2 * self._step_squared
        return np.asarray((-0.5 * squared - self._offset).max(axis=2))
