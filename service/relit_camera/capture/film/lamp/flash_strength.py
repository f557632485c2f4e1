"""How the flashes' strengths go with the direction they come from.

The person themself does not tell it: strengths that grow with the lamp's height look like normals turned down.

How much light each flash gave, told by the person themself, together with their rough shape.

A hand holds the lamp now nearer, now farther, and does not always point it at the face. What a face of this shape
would show under each light, beside what it shows, tells the flash's strength; and the shape follows from all the
pictures once their strengths are known. Both are found in turn, from small pictures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.film.lamp.near_field import CaptureLamp, Surface, distant_light_factor, near_field_irradiance
from relit_camera.capture.geometry.normal_completion import complete_normals
from relit_camera.capture.geometry.normal_integration import integrate_normals
from relit_camera.capture.geometry.photometric_stereo import photometric_stereo

Floats = NDArray[np.float64]

_AIM, _TREND_ROUNDS = 0.1, 8
"""A flash counts half whose strength is so far (logarithm) from the trend, and rounds of the fit that weighs them so.
"""


def remove_half_direction_trend(strength: Floats, lamps_cm: Floats) -> Floats:
    """Strengths (lights,), median 1, with half of what goes with the direction of the lamps (lights, 3) alone.

    A hand may hold the lamp nearer on one side; skin that obeys the law of the cosine only nearly looks the same.
    Either makes a tenth of a difference: half is what to expect of each.
    """
    logs, terms = _logs_and_terms(strength, lamps_cm)
    trend = terms @ np.linalg.lstsq(terms, logs, rcond=None)[0]
    left = logs - (trend - trend.mean()) / 2
    return np.asarray(np.exp(left - np.median(left)))


def set_inverse_square_trend(strength: Floats, lamps_cm: Floats) -> Floats:
    """Strengths (lights,), median 1, that go with the direction of the lamps (lights, 3) as the inverse square does.

    Where the distances are measured, that is what the hand makes. All the rest of the trend is the skin's, which a hand
    that aims at the face has no part in; flashes at which it did not (by `_AIM`) count little.
    """
    logs, terms = _logs_and_terms(strength, lamps_cm)
    rest = logs + 2 * np.log(np.linalg.norm(lamps_cm, axis=1))
    weights: Floats = np.ones(len(logs))
    trend: Floats = np.zeros(len(logs))
    for _ in range(_TREND_ROUNDS):
        root = np.sqrt(weights)
        trend = np.asarray(terms @ np.linalg.lstsq(terms * root[:, None], rest * root, rcond=None)[0])
        weights = np.asarray(1 / (1 + ((rest - trend) / _AIM) ** 2))
    left = logs - trend
    return np.asarray(np.exp(left - np.median(left)))


def _logs_and_terms(strength: Floats, lamps_cm: Floats) -> tuple[Floats, Floats]:
    """Logarithms (lights,) of the strengths, and what is linear in the direction (lights, 4)."""
    directions = lamps_cm / np.linalg.norm(lamps_cm, axis=1, keepdims=True)
    return np.log(np.maximum(strength, 1e-6)), np.concatenate([directions, np.ones((len(directions), 1))], axis=1)


Indices = NDArray[np.intp]
Pictures = NDArray[np.float32]

_ROUNDS = 5
_FACING, _LIT, _SURE = 0.35, 0.3, 0.5
"""Pixels count whose cosine, share of the expected light, and confidence of the normal are no less."""
_FEWEST = 30
"""Pixels that tell a flash's strength."""
_MISFIT, _ALIKE = 0.1, 50
"""Error of the law of the cosine (logarithm), and how many pixels have about the same."""
_USUAL_TILT = 0.25
"""Of a lamp that points 7 degrees beside the head."""
_TILT_ROUNDS = 5
_FACE = 0.25
"""Half the side of the square about the picture's middle whose mean depth is the head's, as a share of the picture."""


@dataclass(frozen=True, eq=False)
class FlashStrengths:
    """The flashes' strengths and what they rest on.

    Attributes:
        strength: (lights,) relative to the median.
        lamps: where they were, and how they pointed.
        surface: the person's, in the small pictures' pixels.
        misfit: (lights,) relative error of the law of the cosine on lit skin (median); infinite, with a strength of 1,
            where hardly any skin is lit.
    """

    strength: Floats
    lamps: list[CaptureLamp]
    surface: Surface
    misfit: Floats

    @property
    def usual_misfit(self) -> float:
        """Median of the misfit where there is one; NaN if nowhere."""
        told = np.isfinite(self.misfit)
        return float(np.median(self.misfit[told])) if told.any() else np.nan

    def consistent(self, times: float) -> Indices:
        """Places of the flashes that fit the person no more than so many times worse than usual."""
        told = np.flatnonzero(np.isfinite(self.misfit))
        return told[self.misfit[told] <= times * self.usual_misfit]


def estimate_flash_strengths(
    pictures: Pictures,
    lamps_cm: Floats,
    matte: Mask,
    head: tuple[float, float],
    pixels_per_cm: float,
    *,
    measured: bool = False,
) -> FlashStrengths:
    """The strengths of the flashes.

    Args:
        pictures: (lights, height, width, 3) linear, small.
        lamps_cm: (lights, 3) where the lamp was, from the head's middle.
        matte: (height, width).
        head: the head's middle in the pictures.
        pixels_per_cm: of these pictures.
        measured: whether the lamps' distances are measured, and not the usual one.
    """
    lamps = [CaptureLamp(place, np.zeros(3)) for place in lamps_cm]
    directions = np.stack([lamp.direction for lamp in lamps])
    settled = set_inverse_square_trend if measured else remove_half_direction_trend
    corrected = pictures
    for _ in range(_ROUNDS):
        shading = photometric_stereo(corrected, directions, matte)
        normals = complete_normals(shading.normals, shading.confidence, matte)
        depth = integrate_normals(normals, matte > 0.5, shading.confidence)
        surface = Surface(normals, _points(depth, head, pixels_per_cm))
        albedo = luminance(shading.albedo)
        sure = (shading.confidence > _SURE) & (matte > 0.9)
        found = [_flash(picture, surface, lamp, albedo, sure) for picture, lamp in zip(pictures, lamps, strict=True)]
        misfit = np.array([each.misfit for each in found])
        told = np.isfinite(misfit)
        strength = np.ones(len(pictures))
        if told.any():
            strength[told] = settled(np.array([each.strength for each in found])[told], lamps_cm[told])
        lamps = [each.lamp for each in found]
        corrected = np.stack(
            [
                picture * (distant_light_factor(surface, lamp) / np.float32(each))[..., None]
                for picture, lamp, each in zip(pictures, lamps, strength, strict=True)
            ]
        )
    return FlashStrengths(strength, lamps, surface, misfit)


def _points(depth: NDArray[np.float32], head: tuple[float, float], pixels_per_cm: float) -> NDArray[np.float32]:
    """The surface's points (height, width, 3) in centimetres from the head's middle."""
    height, width = depth.shape
    x = (np.arange(width) + 0.5 - head[0]) / pixels_per_cm
    y = (head[1] - np.arange(height) - 0.5) / pixels_per_cm
    about = [
        slice(max(0, int(middle - _FACE * side)), int(middle + _FACE * side) + 1)
        for middle, side in ((head[1], height), (head[0], width))
    ]
    z = (depth - np.nanmedian(depth[about[0], about[1]])) / pixels_per_cm
    z = np.where(np.isnan(z), np.nanmin(z), z)
    return np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), z], axis=-1).astype(np.float32)


@dataclass(frozen=True, eq=False)
class _Flash:
    strength: float
    lamp: CaptureLamp
    misfit: float


def _flash(
    picture: Pictures, surface: Surface, lamp: CaptureLamp, albedo: NDArray[np.float32], sure: NDArray[np.bool_]
) -> _Flash:
    """One flash's strength and tilt, by the pixels that it lights, and how far these are from them (median).

    With hardly any such pixels the strength is 1 and the misfit infinite.
    """
    lamp = CaptureLamp(lamp.position_cm, np.zeros(3))
    toward, light = near_field_irradiance(surface, lamp)
    cosine = np.einsum("hwc,hwc->hw", surface.normals, toward)
    expected = albedo * np.maximum(cosine, 0) * light
    counted = sure & (cosine > _FACING) & (expected > 0)
    if counted.sum() < _FEWEST:
        counted = sure & (cosine > 0) & (expected > 0)
    ratio = luminance(picture)[counted] / expected[counted]
    lit = ratio > _LIT * (np.median(ratio) if ratio.size else 0)
    if lit.sum() < _FEWEST:
        return _Flash(1.0, lamp, np.inf)
    logs = np.log(ratio[lit].astype(np.float64))
    tilt = _tilt(logs, surface.points_cm[counted][lit] / np.linalg.norm(lamp.position_cm), lamp.direction)
    left = logs - surface.points_cm[counted][lit] @ tilt / np.linalg.norm(lamp.position_cm)
    middle = float(np.median(left))
    return _Flash(float(np.exp(middle)), CaptureLamp(lamp.position_cm, tilt), float(np.median(np.abs(left - middle))))


def _tilt(logs: Floats, seen: NDArray[np.float32], direction: Floats) -> Floats:
    """How light (count,), logarithms, grows with the place (count, 3), radians from the lamp: (3,) across its way.

    Least squares, what does not fit counting less, drawn toward none as far as few pixels tell it.
    """
    across = np.linalg.svd(direction[None])[2][1:]
    terms = np.concatenate([seen @ across.T, np.ones((len(seen), 1))], axis=1)
    # Errors of neighbouring pixels are alike: so many count as one.
    ridge = np.diag([(_MISFIT / _USUAL_TILT) ** 2 * _ALIKE] * 2 + [0.0])
    weights: Floats = np.ones(len(logs))
    solution: Floats = np.zeros(3)
    for _ in range(_TILT_ROUNDS):
        weighted = terms * weights[:, None]
        solution = np.asarray(
            np.linalg.solve(terms.T @ weighted + ridge + 1e-9 * np.eye(3), weighted.T @ logs), np.float64
        )
        weights = np.asarray(1 / (1 + ((logs - terms @ solution) / _MISFIT) ** 2))
    return np.asarray(solution[:2] @ across)
