"""A person's skin: the photographed albedo in their color, with moles and freckles of their own."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage
from relit_studio.people.skin.scan_pictures import lips_mask, scalp_mask
from relit_studio.people.skin.skin_aging import age_spots, folds
from relit_studio.people.traits.person_traits import Traits

SIDE = 2048
_MEAN_ALBEDO = (0.61, 0.355, 0.265)
"""Linear mean of the photographed face."""
_FACE = slice(600, 1450)
"""Rows and columns of the map that hold the face."""
_MELANIN_SPOT = np.array([0.35, 0.6, 0.8])
"""Fraction of each channel that an age spot absorbs."""
_FOLD_SHADE = np.array([0.16, 0.26, 0.26])
"""Fraction of each channel that a fold absorbs."""
_BLOOD = np.array([0.04, 0.22, 0.18])
"""Fraction of each channel that blood absorbs."""
_FLUSHED = (((392, 400), 48, 0.9), ((638, 400), 48, 0.9), ((513, 405), 26, 0.7), ((513, 590), 40, 0.3))
"""Cheeks, nose and chin: middle and radius in pixels of 1024 x 1024, and how red they are."""


def skin_picture(photo: DisplayImage, traits: Traits) -> DisplayImage:
    """Albedo (2048, 2048, 3), sRGB, in the scan's texture space; `photo` is the cleaned (1024, 1024, 3)."""
    large = cv2.resize(linear_from_uint8(photo), (SIDE, SIDE), interpolation=cv2.INTER_CUBIC).clip(1e-3, 1)
    albedo = np.array(traits.skin) * (large / np.array(_MEAN_ALBEDO)) ** traits.contrast
    scalp = 0.8 * scalp_mask(SIDE)[..., None]
    albedo = albedo * (1 - scalp) + np.array(traits.skin) * 0.82 * scalp
    lips = lips_mask(SIDE)[..., None]
    albedo = albedo * (1 - lips + lips * np.array(traits.lips))
    if traits.flush:
        albedo = albedo * (1 - traits.flush * _blood(traits.seed)[..., None] * _BLOOD)
    if traits.age:
        albedo = albedo * (1 - traits.age * folds(traits.seed)[..., None] * _FOLD_SHADE)
        albedo = albedo * (1 - age_spots(traits.seed, traits.age)[..., None] * _MELANIN_SPOT)
    spots = _spots(traits.seed, traits.freckles)[..., None]
    return uint8_from_linear((albedo * (1 - spots * _MELANIN_SPOT)).astype(np.float32))


def folds_picture(traits: Traits) -> NDArray[np.uint8]:
    """Relief (2048, 2048) of an old skin's folds; 255 is level."""
    return np.asarray(255 * (1 - np.clip(folds(traits.seed), 0, 1)), np.uint8)


def oil(mean: Float64Array) -> Float64Array:
    """0..1 (vertices,) where skin is oily, on the mean head: forehead and nose."""
    forehead = smoothstep(mean[:, 1], 6.5, 9) * smoothstep(mean[:, 2], 6, 9)
    nose = np.exp(-((mean - [0, 1.0, 12.5]) ** 2).sum(axis=1) / 3.5)
    return np.asarray(np.maximum(forehead, nose))


def lips(mean: Float64Array, ring: Float64Array) -> Float64Array:
    """0..1 (vertices,) where the lips are: inside their outer edge `ring` (n, 2), seen from the front."""
    edge = ring.astype(np.float32).reshape(-1, 1, 2)
    inside = np.array([cv2.pointPolygonTest(edge, (float(x), float(y)), True) for x, y in mean[:, :2]])
    return smoothstep(inside, -0.08, 0.12) * (mean[:, 2] > 8.5)


def _blood(seed: int) -> Float64Array:
    """-1..1 (2048, 2048): how much more blood than the photographed skin has, by cheeks and nose, and in blotches."""
    rng = np.random.default_rng(seed + 500)
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.float32)
    red = np.zeros((SIDE, SIDE), np.float32)
    for (column, row), radius, strength in _FLUSHED:
        apart = np.hypot(x - 2 * column - 25 * rng.normal(), y - 2 * row - 25 * rng.normal())
        red += strength * rng.uniform(0.5, 1.2) * np.exp(-((apart / (2 * radius)) ** 2))
    coarse = cv2.resize(rng.normal(size=(24, 24)).astype(np.float32), (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)
    fine = cv2.resize(rng.normal(size=(110, 110)).astype(np.float32), (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(red + 0.14 * coarse + 0.08 * fine, -1, 1.5), np.float64)


def _spots(seed: int, amount: float) -> Float64Array:
    """0..1 (2048, 2048): many faint freckles, `amount` times as many as usual; a few moles, one or two of them dark."""
    rng = np.random.default_rng(seed)
    canvas = np.zeros((SIDE, SIDE), np.float32)
    freckles, moles = int(amount * rng.integers(80, 400)), int(rng.integers(3, 12))
    for radius, depth, count in (((1, 3), (0.05, 0.25), freckles), ((2, 5), (0.35, 0.8), moles)):
        for _ in range(count):
            middle = tuple(int(place) for place in rng.integers(_FACE.start, _FACE.stop, 2))
            cv2.circle(canvas, middle, int(rng.integers(*radius)), float(rng.uniform(*depth)), -1, cv2.LINE_AA)
    return np.asarray(cv2.GaussianBlur(canvas, (0, 0), 1.2), np.float64)
