"""How bright each flash was at the head and where it pointed, estimated together with the person's rough shape.

A hand holds the lamp now nearer, now farther, and does not always point it at the face. The strength of a flash is the
ratio of a picture to what a face of this shape would show under it; the shape follows by photometric stereo from all
pictures once their strengths are known. Both are estimated by turns, from small pictures.

Strengths that vary with the lamp's direction look the same as a tilt of all normals, so the pictures alone do not
show that part. `remove_half_direction_trend` and `set_inverse_square_trend` set it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.film.olat.near_field import CaptureLamp, Surface, distant_light_factor, near_field_irradiance
from relit_camera.capture.geometry.normal_completion import complete_normals
from relit_camera.capture.geometry.normal_integration import integrate_normals
from relit_camera.capture.geometry.photometric_stereo import photometric_stereo

Pictures = NDArray[np.float32]


@dataclass(frozen=True)
class StrengthTunables:
    """Estimation of strengths; `relit evaluate field` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        side_px: pixels a side of the small pictures.
        rounds: alternations of shape and strengths.
        min_cosine, min_relative_light, min_confidence: a pixel counts if its cosine, its light relative to the
            expected, and the confidence of its normal are no less.
        min_pixels: least number of pixels from which a strength is estimated.
        misfit: relative error of the cosine law of a pixel.
        correlated_pixels: neighbors that share one error, and so count as one.
        tilt: standard deviation of the tilt, per radian: that of a lamp that points 7 degrees beside the head.
        tilt_rounds: iterations of the robust fit of the tilt.
        face: half the side of the square whose median depth is the head's, as a fraction of the picture's side.
        aim: relative deviation from the trend over directions at which a flash counts half, as it points elsewhere.
        trend_rounds: iterations of the robust fit of that trend.
        far: factor of the lamps' distance that makes them practically distant.
        max_misfit_ratio: flashes that fit the shape worse than the median by this factor are left out.
    """

    side_px: int = 96
    rounds: int = 5
    min_cosine: float = 0.35
    min_relative_light: float = 0.3
    min_confidence: float = 0.5
    min_pixels: int = 30
    misfit: float = 0.1
    correlated_pixels: int = 50
    tilt: float = 0.25
    tilt_rounds: int = 5
    face: float = 0.25
    aim: float = 0.1
    trend_rounds: int = 8
    far: float = 1e3
    max_misfit_ratio: float = 3.0


_TUNABLES = StrengthTunables()


@dataclass(frozen=True, eq=False)
class FlashStrengths:
    """Strengths of the flashes, and the shape from which they were estimated.

    Attributes:
        strength: (lights,) relative to the median.
        lamps: positions and tilts of the lamp.
        surface: the person's, in the small pictures' pixels.
        misfit: (lights,) median relative error of the cosine law on lit skin; infinite, with a strength of 1, where
            hardly any skin is lit.
    """

    strength: Float64Array
    lamps: list[CaptureLamp]
    surface: Surface
    misfit: Float64Array

    @property
    def median_misfit(self) -> float:
        """Median of the finite misfits; NaN if there is none."""
        finite = np.isfinite(self.misfit)
        return float(np.median(self.misfit[finite])) if finite.any() else np.nan

    def consistent(self, max_misfit_ratio: float = _TUNABLES.max_misfit_ratio) -> Indices:
        """Growing indices of the flashes whose misfit is at most this multiple of the median."""
        finite = np.flatnonzero(np.isfinite(self.misfit))
        return finite[self.misfit[finite] <= max_misfit_ratio * self.median_misfit]


@dataclass(frozen=True, eq=False)
class StrengthPictures:
    """Small pictures from which strengths are estimated.

    Attributes:
        pictures: (lights, height, width, 3) float32 linear RGB, not negative.
        matte: (height, width) the person's alpha.
        scale: their size relative to the pictures they were made of.
    """

    pictures: Pictures
    matte: Mask
    scale: float


def downsample_for_strengths(pictures: NDArray[np.floating], matte: Mask) -> StrengthPictures:
    """Shrink square pictures (lights, size, size, 3) and their matte (size, size) to at most 96 pixels a side."""
    side = min(_TUNABLES.side_px, len(matte))
    small = np.stack(
        [cv2.resize(each.astype(np.float32), (side, side), interpolation=cv2.INTER_AREA) for each in pictures]
    )
    alpha = cv2.resize(matte, (side, side), interpolation=cv2.INTER_AREA)
    return StrengthPictures(np.maximum(small, 0), alpha, side / len(matte))


def estimate_flash_strengths(
    pictures: Pictures,
    lamps_cm: Float64Array,
    matte: Mask,
    head: tuple[float, float],
    pixels_per_cm: float,
    *,
    measured: bool = False,
) -> FlashStrengths:
    """Estimate the strengths of the flashes from small pictures.

    Args:
        pictures: (lights, height, width, 3) linear RGB; `downsample_for_strengths` makes them.
        lamps_cm: (lights, 3) positions of the lamp from the head's middle.
        matte: (height, width) the person's alpha.
        head: x and y of the head's middle in these pictures, pixels.
        pixels_per_cm: scale of these pictures at the head.
        measured: whether the lamp's distances are measured rather than assumed.
    """
    lamps = [CaptureLamp(place, np.zeros(3)) for place in lamps_cm]
    directions = np.stack([lamp.direction for lamp in lamps])
    set_trend = set_inverse_square_trend if measured else remove_half_direction_trend
    corrected = pictures
    for _ in range(_TUNABLES.rounds):
        shading = photometric_stereo(corrected, directions, matte)
        normals = complete_normals(shading.normals, shading.confidence, matte)
        depth = integrate_normals(normals, matte > 0.5, shading.confidence)
        surface = Surface(normals, _surface_points(depth, head, pixels_per_cm))
        albedo = luminance(shading.albedo)
        confident = (shading.confidence > _TUNABLES.min_confidence) & (matte > 0.9)
        found = [
            _fit_flash(picture, surface, lamp, albedo, confident) for picture, lamp in zip(pictures, lamps, strict=True)
        ]
        misfit = np.array([each.misfit for each in found])
        finite = np.isfinite(misfit)
        strength = np.ones(len(pictures))
        if finite.any():
            strength[finite] = set_trend(np.array([each.strength for each in found])[finite], lamps_cm[finite])
        lamps = [each.lamp for each in found]
        corrected = np.stack(
            [
                picture * (distant_light_factor(surface, lamp) / np.float32(each))[..., None]
                for picture, lamp, each in zip(pictures, lamps, strength, strict=True)
            ]
        )
    return FlashStrengths(strength, lamps, surface, misfit)


def misfit_under_distant_lamps(
    pictures: Pictures,
    lamps_cm: Float64Array,
    matte: Mask,
    head: tuple[float, float],
    pixels_per_cm: float,
    *,
    measured: bool = False,
) -> float:
    """Median misfit if the lamps were far away: what the correction of the near field gains.

    Arguments as in `estimate_flash_strengths`.
    """
    distant = lamps_cm * _TUNABLES.far
    return estimate_flash_strengths(pictures, distant, matte, head, pixels_per_cm, measured=measured).median_misfit


def remove_half_direction_trend(strength: Float64Array, lamps_cm: Float64Array) -> Float64Array:
    """Strengths (lights,), median 1, less half of their linear trend over the lamps' directions.

    A hand may hold the lamp nearer on one side, and skin that deviates from the cosine law looks the same. Each makes
    about a tenth of a difference, so half of the trend is expected to be the hand's.

    Args:
        strength: (lights,).
        lamps_cm: (lights, 3) positions from the head's middle.
    """
    logs, terms = _logs_and_terms(strength, lamps_cm)
    trend = terms @ np.linalg.lstsq(terms, logs, rcond=None)[0]
    adjusted = logs - (trend - trend.mean()) / 2
    return np.asarray(np.exp(adjusted - np.median(adjusted)))


def set_inverse_square_trend(strength: Float64Array, lamps_cm: Float64Array) -> Float64Array:
    """Strengths (lights,), median 1, whose trend over directions is that of the inverse square of the distances.

    Where distances are measured, the inverse square is the hand's part of the trend, and the rest is the skin's
    deviation from the cosine law. The trend is fitted robustly, since flashes that point elsewhere deviate from it.

    Args:
        strength: (lights,).
        lamps_cm: (lights, 3) measured positions from the head's middle.
    """
    logs, terms = _logs_and_terms(strength, lamps_cm)
    rest = logs + 2 * np.log(np.linalg.norm(lamps_cm, axis=1))
    weights: Float64Array = np.ones(len(logs))
    trend: Float64Array = np.zeros(len(logs))
    for _ in range(_TUNABLES.trend_rounds):
        root = np.sqrt(weights)
        trend = np.asarray(terms @ np.linalg.lstsq(terms * root[:, None], rest * root, rcond=None)[0])
        weights = np.asarray(1 / (1 + ((rest - trend) / _TUNABLES.aim) ** 2))
    adjusted = logs - trend
    return np.asarray(np.exp(adjusted - np.median(adjusted)))


def _logs_and_terms(strength: Float64Array, lamps_cm: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Logarithms (lights,) of the strengths, and the terms (lights, 4) of a function linear in the direction."""
    directions = lamps_cm / np.linalg.norm(lamps_cm, axis=1, keepdims=True)
    return np.log(np.maximum(strength, 1e-6)), np.concatenate([directions, np.ones((len(directions), 1))], axis=1)


def _surface_points(depth: NDArray[np.float32], head: tuple[float, float], pixels_per_cm: float) -> NDArray[np.float32]:
    """Points (height, width, 3) of a surface in centimeters from the head's middle.

    Args:
        depth: (height, width) toward the camera in pixels; NaN outside the surface.
        head: x and y of the head's middle, pixels.
        pixels_per_cm: scale of the picture at the head.
    """
    height, width = depth.shape
    x = (np.arange(width) + 0.5 - head[0]) / pixels_per_cm
    y = (head[1] - np.arange(height) - 0.5) / pixels_per_cm
    about = [
        slice(max(0, int(middle - _TUNABLES.face * side)), int(middle + _TUNABLES.face * side) + 1)
        for middle, side in ((head[1], height), (head[0], width))
    ]
    z = (depth - np.nanmedian(depth[about[0], about[1]])) / pixels_per_cm
    z = np.where(np.isnan(z), np.nanmin(z), z)
    return np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), z], axis=-1).astype(np.float32)


@dataclass(frozen=True, eq=False)
class _FlashFit:
    """Strength, lamp with its tilt, and misfit of one flash; see `FlashStrengths`."""

    strength: float
    lamp: CaptureLamp
    misfit: float


def _fit_flash(
    picture: Pictures, surface: Surface, lamp: CaptureLamp, albedo: NDArray[np.float32], confident: NDArray[np.bool_]
) -> _FlashFit:
    """Strength and tilt of one flash from the pixels that it lights, with their median residual as misfit.

    With too few such pixels the strength is 1 and the misfit infinite.

    Args:
        picture: (height, width, 3) linear RGB.
        surface: the person's shape.
        lamp: position of the lamp.
        albedo: (height, width).
        confident: (height, width) mask of the pixels whose normal and matte are certain.
    """
    lamp = CaptureLamp(lamp.position_cm, np.zeros(3))
    toward, light = near_field_irradiance(surface, lamp)
    cosine = np.einsum("hwc,hwc->hw", surface.normals, toward)
    expected = albedo * np.maximum(cosine, 0) * light
    counted = confident & (cosine > _TUNABLES.min_cosine) & (expected > 0)
    if counted.sum() < _TUNABLES.min_pixels:
        counted = confident & (cosine > 0) & (expected > 0)
    ratio = luminance(picture)[counted] / expected[counted]
    lit = ratio > _TUNABLES.min_relative_light * (np.median(ratio) if ratio.size else 0)
    if lit.sum() < _TUNABLES.min_pixels:
        return _FlashFit(1.0, lamp, np.inf)
    logs = np.log(ratio[lit].astype(np.float64))
    tilt = _fit_tilt(logs, surface.points_cm[counted][lit] / np.linalg.norm(lamp.position_cm), lamp.direction)
    residual = logs - surface.points_cm[counted][lit] @ tilt / np.linalg.norm(lamp.position_cm)
    middle = float(np.median(residual))
    return _FlashFit(
        float(np.exp(middle)), CaptureLamp(lamp.position_cm, tilt), float(np.median(np.abs(residual - middle)))
    )


def _fit_tilt(logs: Float64Array, places: NDArray[np.float32], direction: Float64Array) -> Float64Array:
    """Gradient (3,) of light across the head, perpendicular to the direction to the lamp.

    Robust least squares with a prior of no tilt, which decides where there are few pixels.

    Args:
        logs: (count,) logarithms of the ratio of light to the expected.
        places: (count, 3) points from the head's middle, in distances of the lamp.
        direction: (3,) unit vector toward the lamp.
    """
    across = np.linalg.svd(direction[None])[2][1:]
    terms = np.concatenate([places @ across.T, np.ones((len(places), 1))], axis=1)
    prior = (_TUNABLES.misfit / _TUNABLES.tilt) ** 2 * _TUNABLES.correlated_pixels
    ridge = np.diag([prior] * 2 + [0.0])
    weights: Float64Array = np.ones(len(logs))
    solution: Float64Array = np.zeros(3)
    for _ in range(_TUNABLES.tilt_rounds):
        weighted = terms * weights[:, None]
        solution = np.asarray(
            np.linalg.solve(terms.T @ weighted + ridge + 1e-9 * np.eye(3), weighted.T @ logs), np.float64
        )
        weights = np.asarray(1 / (1 + ((logs - terms @ solution) / _TUNABLES.misfit) ** 2))
    return np.asarray(solution[:2] @ across)
