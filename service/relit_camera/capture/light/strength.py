"""How much light each flash gave, told by the person themself, together with their rough shape.

A hand holds the lamp now nearer, now farther, and does not always point it at the face. What a face of this shape
would show under each light, beside what it shows, tells the flash's strength; and the shape follows from all the
pictures once their strengths are known. Both are found in turn, from small pictures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.light.near_field import Surface, light_at, to_distant
from relit_camera.geometry.completion import complete_normals
from relit_camera.geometry.depth import integrate_normals
from relit_camera.geometry.photometric_stereo import photometric_stereo
from relit_camera.space.colour import luminance
from relit_camera.space.images import Mask

Floats = NDArray[np.float64]
Pictures = NDArray[np.float32]

_ROUNDS = 5
_FACING, _LIT, _SURE = 0.35, 0.3, 0.5
"""Pixels count whose cosine, share of the expected light, and confidence of the normal are no less."""
_FEWEST = 30
_FACE = 0.25
"""Half the side of the square about the picture's middle whose mean depth is the head's, as a share of the picture."""


@dataclass(frozen=True, eq=False)
class Strengths:
    """The flashes' strengths and what they rest on.

    Attributes:
        strength: (lights,) relative to the median.
        surface: the person's, in the small pictures' pixels.
        misfit: (lights,) relative error of the law of the cosine on lit skin (median).
    """

    strength: Floats
    surface: Surface
    misfit: Floats


def find_strengths(
    pictures: Pictures, lamps_cm: Floats, matte: Mask, head: tuple[float, float], pixels_per_cm: float
) -> Strengths:
    """The strengths of the flashes.

    Args:
        pictures: (lights, height, width, 3) linear, small.
        lamps_cm: (lights, 3) where the lamp was, from the head's middle.
        matte: (height, width).
        head: the head's middle in the pictures.
        pixels_per_cm: of these pictures.
    """
    directions = lamps_cm / np.linalg.norm(lamps_cm, axis=1, keepdims=True)
    strength = np.ones(len(pictures))
    corrected = pictures
    for _ in range(_ROUNDS):
        shading = photometric_stereo(corrected, directions, matte)
        normals = complete_normals(shading.normals, shading.confidence, matte)
        depth = integrate_normals(normals, matte > 0.5, shading.confidence)
        surface = Surface(normals, _points(depth, head, pixels_per_cm))
        albedo = luminance(shading.albedo)
        sure = (shading.confidence > _SURE) & (matte > 0.9)
        found = np.array(
            [_strength(p, surface, lamp, albedo, sure) for p, lamp in zip(pictures, lamps_cm, strict=True)]
        )
        strength = _without_half_the_trend(found[:, 0], directions)
        corrected = np.stack(
            [
                picture * (to_distant(surface, lamp) / np.float32(each))[..., None]
                for picture, lamp, each in zip(pictures, lamps_cm, strength, strict=True)
            ]
        )
    return Strengths(strength, surface, found[:, 1])


def _without_half_the_trend(strength: Floats, directions: Floats) -> Floats:
    """Strengths (lights,), median 1, with half of what goes with the direction (lights, 3) alone.

    A hand may hold the lamp nearer on one side; skin that obeys the law of the cosine only nearly looks the same.
    Either makes a tenth of a difference: half is what to expect of each.
    """
    logs = np.log(np.maximum(strength, 1e-6))
    terms = np.concatenate([directions, np.ones((len(directions), 1))], axis=1)
    trend = terms @ np.linalg.lstsq(terms, logs, rcond=None)[0]
    left = logs - (trend - trend.mean()) / 2
    return np.asarray(np.exp(left - np.median(left)))


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


def _strength(
    picture: Pictures, surface: Surface, lamp_cm: Floats, albedo: NDArray[np.float32], sure: NDArray[np.bool_]
) -> tuple[float, float]:
    """Of one flash, and how far pixels are from it, relative (median)."""
    toward, light = light_at(surface, lamp_cm)
    cosine = np.einsum("hwc,hwc->hw", surface.normals, toward)
    expected = albedo * np.maximum(cosine, 0) * light
    counted = sure & (cosine > _FACING) & (expected > 0)
    if counted.sum() < _FEWEST:
        counted = sure & (cosine > 0) & (expected > 0)
    ratio = luminance(picture)[counted] / expected[counted]
    lit = ratio > _LIT * np.median(ratio)
    strength = float(np.median(ratio[lit]))
    return strength, float(np.median(np.abs(ratio[lit] / strength - 1)))
